//! What may be left out, where and how strong: the list that a recording is screened with.

use crate::section::Section;
use tracktwin_track::extension::{Class, ExtensionInstance, KINDS, Kind, KindParameter};

/// Of a parameter that may be zero, the least part of its greatest value that counts.
const LEAST: f64 = 1e-2;

/// A piece of physics at a place, in terms of the recording, with the parameters to be found.
#[derive(Clone, Debug)]
pub struct Candidate {
    /// What it is.
    pub kind: &'static Kind,
    /// The physics with its place; compared sleepers count from 0, places are the recording's.
    pub extension: ExtensionInstance,
    /// Parameters to be fitted, inside their ranges.
    pub free: Vec<&'static KindParameter>,
    /// Values of the free parameters that screening tries.
    pub trials: Vec<Vec<f64>>,
}

impl Candidate {
    /// Whether it is nowhere in particular: all along the track, at the wheel or in the sensor.
    pub fn is_everywhere(&self) -> bool {
        self.extension.sleepers.is_none() && self.extension.x_m.is_none()
    }

    /// Whether it acts by laws that the wheel's load decides about.
    pub(crate) fn is_under_load(&self) -> bool {
        self.kind.classes.contains(&Class::Load)
    }

    /// Whether it does nothing but add to the dynamic stiffness of track, vehicle or sensor: its model
    /// lacks neither what a load decides nor the phase of a shape.
    pub(crate) fn is_linear(&self) -> bool {
        let classes = self.kind.classes;
        !classes.contains(&Class::Load) && !classes.contains(&Class::Wavelength)
    }

    /// The extension with values for the free parameters.
    pub fn with(&self, values: &[f64]) -> ExtensionInstance {
        let pairs = self.free.iter().zip(values);
        pairs.fold(self.extension.clone(), |extension, (parameter, &value)| {
            extension.with(parameter.name, value)
        })
    }

    /// Logarithms of values of the free parameters; of none a hundredth of what is usual.
    pub fn logarithms(&self, values: &[f64]) -> Vec<f64> {
        let logarithm = |(parameter, &value): (&&KindParameter, &f64)| {
            value.max(LEAST * parameter.v_track[1]).ln()
        };
        self.free.iter().zip(values).map(logarithm).collect()
    }

    /// Whether what was found, by the logarithms of the free parameters, may be of this kind.
    pub fn is_plausible(&self, logarithms: &[f64]) -> bool {
        let plausible = |(parameter, &value): (&&KindParameter, &f64)| {
            let [low, high] = parameter.v_track.map(f64::ln);
            let beyond = (low - value).max(value - high);
            beyond <= parameter.slack
        };
        self.free.iter().zip(logarithms).all(plausible)
    }

    /// Middle and standard deviation of a parameter's logarithm before anything is measured: its
    /// range holds two deviations.
    pub fn prior(parameter: &KindParameter) -> (f64, f64) {
        let [low, high] = Self::range(parameter);
        (0.5 * (low + high), 0.5 * (high - low) + 0.1)
    }

    /// Logarithms of the ends of a parameter's range; of one that may be zero the lower end is a
    /// hundredth of the upper.
    pub fn range(parameter: &KindParameter) -> [f64; 2] {
        let [low, high] = parameter.v_track;
        [low.max(LEAST * high).ln(), high.ln()]
    }
}

/// Every candidate for a section: each kind at each place it may have.
pub fn candidates(section: &Section) -> Vec<Candidate> {
    let mut all = Vec::new();
    for kind in KINDS {
        for (extension, free, trials) in families(kind, section) {
            let free = free.iter().map(|name| parameter(kind, name)).collect();
            all.push(Candidate { kind, extension, free, trials });
        }
    }
    all
}

type Family = (ExtensionInstance, &'static [&'static str], Vec<Vec<f64>>);

pub(crate) fn parameter(kind: &'static Kind, name: &str) -> &'static KindParameter {
    let found = kind.parameters.iter().find(|parameter| parameter.name == name);
    found.expect("candidates name parameters of the registry")
}

/// Places and trial values of a kind.
fn families(kind: &'static Kind, section: &Section) -> Vec<Family> {
    let mut families = local(kind, section);
    families.extend(everywhere(kind));
    families
}

/// Those with a place on the track.
fn local(kind: &'static Kind, section: &Section) -> Vec<Family> {
    let new = || ExtensionInstance::new(kind.physics);
    let on = |sleepers: Vec<Vec<usize>>, free: &'static [&'static str], trials: &[&[f64]]| {
        let trials = grid(trials);
        let at = |sleepers| (new().on(sleepers), free, trials.clone());
        sleepers.into_iter().map(at).collect()
    };
    match kind.physics {
        "rail_joint" => at_points(
            section,
            new,
            &["bending_factor", "dip_m", "length_m"],
            &[
                vec![0.15, 0.0, 2e-2],
                vec![0.4, 0.0, 2e-2],
                vec![1.0, 6e-5, 2e-2],
                vec![0.3, 6e-5, 2e-2],
            ],
        ),
        "squat" => at_points(
            section,
            new,
            &["depth_m", "length_m"],
            &[vec![2e-5, 3e-3], vec![2e-5, 6e-3], vec![2e-5, 1e-2]],
        ),
        "missing_railpad" => on(single(section), &["stiffness_N_per_m"], &[&[5e6, 1.5e7]]),
        "sleeper_bolt" => on(with_neighbours(section), &["stiffness_N_per_m"], &[&[1e7, 3e7]]),
        "hanging_sleeper" => hanging(section, new),
        "subgrade_layer" => on(single(section), LAYER, &[&[0.5, 2.0], &[1.5e7, 5e7], &[1e3]]),
        "fastening_clamp" => clamps(section, new),
        _ => Vec::new(),
    }
}

/// Every sleeper.
fn single(section: &Section) -> Vec<Vec<usize>> {
    (0..section.sleepers).map(|sleeper| vec![sleeper]).collect()
}

/// Every sleeper and every pair of neighbours.
fn with_neighbours(section: &Section) -> Vec<Vec<usize>> {
    let pairs = (1..section.sleepers).map(|sleeper| vec![sleeper - 1, sleeper]);
    single(section).into_iter().chain(pairs).collect()
}

/// A layer's parameters.
const LAYER: &[&str] = &["mass_kg", "stiffness_N_per_m", "damping_N_s_per_m"];

/// Resonances of sensors that are tried, in Hz.
const SENSORS_HZ: &[f64] =
    &[1.2e3, 1.4e3, 1.7e3, 2e3, 2.3e3, 2.6e3, 2.9e3, 3.2e3, 3.6e3, 4e3, 4.5e3, 5e3, 6e3, 7e3, 9e3];

/// Stiffnesses of axle boxes that are tried, in N/m: resonances a tenth apart, for they are sharp.
const AXLE_BOXES_N_M: &[f64] = &[
    5e7, 6.2e7, 7.6e7, 9.4e7, 1.2e8, 1.4e8, 1.8e8, 2.2e8, 2.7e8, 3.3e8, 4.1e8, 5e8, 6.2e8, 7.6e8,
    9.4e8,
];

/// Distances of a second wheel that are tried, in m: the rail's waves at 1 kHz are 15 steps long. As
/// far as the track is modelled beyond what is compared.
fn second_wheels_m() -> Vec<f64> {
    (0..46).map(|step| 0.2 + 0.04 * f64::from(step)).collect()
}

/// Those that are everywhere.
fn everywhere(kind: &'static Kind) -> Option<Family> {
    let (free, trials): (&'static [&'static str], Vec<Vec<f64>>) = match kind.physics {
        "sleeper_bolt" => (&["stiffness_N_per_m"], grid(&[&[5e6, 1e7, 2e7, 4e7]])),
        "subgrade_layer" => {
            (LAYER, grid(&[&[0.5, 1.5, 4.0], &[1.5e7, 3e7, 6e7, 1e8], &[5e2, 2e3]]))
        }
        "flexible_axle_box" => (
            &["mass_kg", "stiffness_N_per_m", "damping_N_s_per_m"],
            grid(&[&[2.0, 6.0, 15.0], AXLE_BOXES_N_M, &[2e3]]),
        ),
        "second_wheel" => (&["distance_m"], grid(&[&second_wheels_m()])),
        "frequency_dependent_railpad" => (
            &["stiffness_ratio", "relaxation_time_s"],
            grid(&[&[0.5, 1.5, 3.0], &[3e-5, 1e-4, 3e-4, 1e-3]]),
        ),
        "rail_cross_section" => {
            (&["frequency_Hz", "stiffness_N_per_m"], grid(&[&[6e3, 8e3, 1.1e4], &[5e8, 1e9, 2e9]]))
        }
        "sensor_mount_resonance" => {
            (&["frequency_Hz", "damping_ratio"], grid(&[SENSORS_HZ, &[0.02, 0.05, 0.15]]))
        }
        _ => return None,
    };
    Some((ExtensionInstance::new(kind.physics), free, trials))
}

/// Over every sleeper and every pair of neighbours, with gaps that close while the wheel is near and
/// one that does not.
fn hanging(section: &Section, new: impl Fn() -> ExtensionInstance) -> Vec<Family> {
    let families = |sleepers: Vec<usize>| {
        let closing = (new().on(sleepers.clone()), &["gap_m"][..], grid(&[CLOSING_GAPS_M]));
        let open = (new().on(sleepers).with("gap_m", OPEN_GAP_M), &[][..], grid(&[]));
        [closing, open]
    };
    with_neighbours(section).into_iter().flat_map(families).collect()
}

/// Gaps in m that close while the wheel is above the sleeper, or near it.
const CLOSING_GAPS_M: &[f64] = &[1e-4, 1.6e-4];

/// A gap in m that no load closes.
const OPEN_GAP_M: f64 = 4e-4;

/// At every sleeper and every middle of a span.
fn at_points(
    section: &Section,
    new: impl Fn() -> ExtensionInstance,
    free: &'static [&'static str],
    trials: &[Vec<f64>],
) -> Vec<Family> {
    let half_span_m = 0.5 * section.design.sleeper.spacing_m;
    (0..2 * section.sleepers - 1)
        .map(|half| {
            let x_m = section.first_x_m + half as f64 * half_span_m;
            (new().at([x_m, x_m]), free, trials.to_vec())
        })
        .collect()
}

/// On every second to fifth sleeper.
fn clamps(section: &Section, new: impl Fn() -> ExtensionInstance) -> Vec<Family> {
    let free: &[&str] = &["vertical_N_per_m", "rotational_N_m_per_rad"];
    let trials = grid(&[&[3e7, 1.5e8], &[3e4, 3e5]]);
    let patterns = (2..=5).flat_map(|every| (0..every).map(move |first| (every, first)));
    patterns
        .map(|(every, first)| {
            let sleepers = (first..section.sleepers).step_by(every);
            (new().on(sleepers), free, trials.clone())
        })
        .collect()
}

/// All combinations of one value from each list.
fn grid(lists: &[&[f64]]) -> Vec<Vec<f64>> {
    lists.iter().fold(vec![Vec::new()], |all, list| {
        all.iter()
            .flat_map(|head| list.iter().map(|&value| [&head[..], &[value]].concat()))
            .collect()
    })
}
