//! A second simulator of axle-box acceleration, over V-Track or a line, with hidden physics.
//!
//! A blind trial is meaningful only if its simulator is independent of the track model. This simulator
//! uses the data types of scenes, effects and errors of `tracktwin_reference_simulator`, and its own
//! assumptions:
//!
//! | Part | Assumption |
//! |---|---|
//! | rail | Timoshenko beam by finite differences on a staggered grid, 12 cells a span; damping of bending alone, 0.06 % of critical at 1 kHz; free ends three spans beyond the scene, where about half of a wave is swallowed |
//! | half sleeper | 8 rigid bars with hinges and shear between them; ballast at four points; bending damping 0.16 % of critical at 1 kHz |
//! | time | generalised-alpha scheme, 10 us, spectral radius 0.8 |
//! | contact | Hertzian with exponent 3/2 and loss of contact, of crossed cylinders (65 and 60 mm); a point, without patch |
//! | irregularity | white noise through two filters of first order; waves beyond 2 m fade; of a pass's power the share `unrepeated` is its own |
//! | rough rail | driving noise of another level; further noise through a band of fourth-order filters |
//! | rig | rail seats off by 1 mm (2 at most), railpad damping by 10 %, wheel and contact by 1 % at most, wheel orders 1 to 4 of up to 4 um / order |
//! | channel | a shelf of up to 0.2 dB; noise below 5 Hz of half the white noise's size |
//! | odometer | error drawn every 0.7 m, cosines between |
//!
//! | Hidden effect | Assumption |
//! |---|---|
//! | `rail_joint` | two parabolas of 2.5 length scales that meet in a kink; hinges of the softened length |
//! | `squat` | Gaussian hollow of 0.212 lengths standard deviation |
//! | `corrugation` | wavelength drifts by 3 % over 17 waves; second harmonic of 20 % |
//! | `wheel_flat` | `(1 - (2 u / l)^2)^2`, edges worn round |
//! | `wheel_out_of_round` | with a tenth of its amplitude in the next order |
//! | `fastening_clamp` | spring to the sleeper and rotation to the ground, 5 % loss at 1 kHz |
//! | `missing_railpad` | damping falls with stiffness to the power 0.75 |
//! | `sleeper_bolt` | half at the end, half 30 mm inside it, 5 % loss at 1 kHz |
//! | `hanging_sleeper` | gap at each of the four points; full stiffness 20 um after closing; a fifth of the damping stays |
//! | `subgrade_layer` | neighbouring masses share a tenth of stiffness and damping |
//! | `flexible_axle_box` | the load acts on the box |
//! | `frequency_dependent_railpad` | two branches of half the stiffness, 0.58 and 1.73 relaxation times |
//! | `load_dependent_railpad` | `k_p` at reference and toe load together; damping follows stiffness |
//! | `rail_cross_section` | two resonances: 85 % of the compliance in the first, 15 % in one 1.7 times as high |
//! | `sensor_mount_resonance` | oscillator by the bilinear transform |
//! | `clipping`, `gain_error`, `position_error` | as stated; the limit comes after gain and steps |
//! | `electrical_hum` | with a third harmonic of 15 % |
//! | `rail_absorber` | at the nearest node, up to 5 mm off |
//! | `cracked_sleeper` | 20 mm of the whole sleeper, centred under the rail |
//! | `linked_sleepers` | 5 % loss at 1 kHz; 400 MN/m at most |
//! | `wheel_mode` | mode of the free wheel: the hub moves against the rim by the ratio of modal mass to wheel |

//! On a line, which a scene names by its preset, sections, masses and loads are those of the preset. Further
//! assumptions differ from those above:
//!
//! | Part | Assumption |
//! |---|---|
//! | rail | 16 cells a span; damping of bending alone, by the preset |
//! | half sleeper | 8 bars, the rail seat at the end of one of them; no slope in the middle of the sleeper; bars that turn with their ends; ballast at all ends, 50 to 100 % as stiff under the middle quarter; loss factor 0.7 % at 700 Hz |
//! | vehicle | all wheels of the preset on the same rail; hidden effects are in the recorded one |
//! | irregularity | falls with a power of the wave number of 2.6 to 3.4 above 8 rad/m; waves beyond 3 m fade; the contact patch filters it and all defects (Remington), with a half length within 10 % of Hertz's |
//! | defects of the rail | the wheel does not reach the bottom of narrow hollows |
//! | vehicle and track | rail seats off by 5 mm (12 at most), wheel by 2 %, contact by 5 % at most, wheel orders 1 to 4 of up to 80 um / order^2 |
//! | pass | speed drifts by up to 3 % |
//! | recorder | 25.6 kHz, filter without phase up to 10 kHz |
//! | odometer | error drawn every 6 spans |
//! | `hanging_sleeper` | full stiffness 0.1 mm after closing |
//! | `cracked_sleeper` | 50 mm of the sleeper, at the rail seat |

mod band;
mod biquad;
mod body;
mod chain;
mod contact;
mod defect;
mod element;
mod limits;
mod nuisance;
mod pass;
mod rail;
mod random;
mod record;
mod recorder;
mod scale;
mod scheme;
mod seat;
mod sleeper;
mod surface;
mod system;
mod texture;
mod track;
mod vehicle;

pub use record::{record, simulate};
