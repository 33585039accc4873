//! Diagnosis: differences between simulation and recording, left-out physics, and the gain from its
//! inclusion.
//!
//! This crate contains the baseline, the null model, the detection, the hypotheses and their acceptance. Its
//! functions have no side effects: recordings and null simulations are input values, and a diagnosis is the
//! result. The crate of the track model contains the catalogue of physics. Other crates write pages and
//! files.

mod bands;
mod baseline;
mod behaviour;
mod calibration;
mod candidate;
mod conclusion;
mod confirmation;
mod estimate;
mod forward;
mod further_wheels;
mod held_out;
mod joined;
mod knots;
mod neighbours;
mod null_model;
mod observation;
mod outcome;
mod patch_scan;
mod port_scan;
mod prepared_recording;
mod profile;
mod quantity;
mod screen;
mod search;
mod section;
mod sentence;
mod signature;
mod sleeper_pattern;
mod spectra;
mod suggestion;
mod transfer;
mod variation;

pub use bands::Bands;
pub use baseline::{Mean, Unknowns};
pub use behaviour::{Behaviour, Element};
pub use calibration::{Calibration, CalibrationError, Minimum, Problem};
pub use candidate::{Candidate, candidates};
pub use conclusion::{Evidence, passes_alone};
pub use confirmation::{ConfirmationError, Confirming};
pub use estimate::Estimate;
pub use forward::{Forward, Linearised};
pub use joined::{DiagnosedSection, diagnosed_sections, joined};
pub use null_model::{NullError, NullModel};
pub use observation::Observation;
pub use outcome::{
    BeforeAfter, Confirmation, ConfirmedSpeed, Diagnosis, FORMAT, FitScores, Hypothesis, Levels,
    Location, Mismatch, Score, Scores, SectionVerdict, SleeperValues, UNKNOWN, Verdict,
    section_folder,
};
pub use patch_scan::{Fixed, Patch};
pub use port_scan::{PortPlace, PortScan, UnknownElement};
pub use prepared_recording::{
    PreparationError, PreparedRecording, Uncovered, check_length, check_track, highest_compared_hz,
    short_passes,
};
pub use profile::WheelTurns;
pub use quantity::{Common, Own};
pub use screen::{Template, templates};
pub use search::{Fitted, Round, SearchOutcome, Stage, first_calibration, search};
pub use section::{Section, owner};
pub use sentence::run_of;
pub use signature::signature;
pub use sleeper_pattern::SleeperPattern;
pub use spectra::{Spectra, SpeedSpectra, are_one_speed};
pub use tracktwin_inspection::separate_wavelengths;
pub use variation::{
    Amplitude, BALLAST_ERROR, EXCEPTION_NATS, Exception, FoundSupportChange, Quadratic,
    SupportChange, SupportChangeKind, Variation, expect_variation, joined_support_changes,
    learn_railpad_damping, learn_variation,
};
