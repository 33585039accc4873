//! Properties of a described track: stiffness, resonances, surface, contact.

mod doubts;

use num_complex::Complex64;
use serde::Serialize;
use std::f64::consts::{PI, SQRT_2, TAU};
use tracktwin_parameters::{Parameter, ParameterSet, Track, TrackDesign};
use tracktwin_track::frequency::{FrequencyError, ReceptancePoint, peaks, receptance};
use tracktwin_track::model::{
    ContactPatch, HertzContact, Mesh, ModelError, Roughness, Support, TrackModel,
};

/// Number of spans of the track; the properties are computed at its middle.
const SPANS: usize = 80;

/// Number of elements of the rail in a span, and of a half sleeper.
const ELEMENTS: usize = 8;

/// Lowest and highest frequency in Hz for a track of V-Track's scale. For other tracks they are divided by
/// the length ratio to V-Track. `PER_OCTAVE` frequencies per octave are used.
const FREQUENCIES_HZ: [f64; 2] = [60.0, 15_000.0];
const PER_OCTAVE: f64 = 48.0;

/// Frequency in Hz at which a receptance is static.
const STATIC_HZ: f64 = 0.5;

/// Minimum prominence of a resonance in dB.
const PROMINENCE_DB: f64 = 0.3;

/// Relative change of a parameter whose effect on the level is computed.
const CHANGE: f64 = 0.1;

/// Wavelengths in m, and limits of the one-third-octave levels in dB re 1 um (ISO 3095:2013, Figure 2).
const ISO_3095: [(f64, f64); 5] =
    [(0.4, 17.1), (0.2, 11.0), (0.1, 4.9), (0.05, -1.1), (0.025, -5.6)];

/// Properties of a described track.
#[derive(Clone, Debug, Serialize)]
pub struct TrackCheck {
    /// Name of the track description.
    pub name: String,
    /// Mass of a half sleeper in kg.
    pub half_sleeper_mass_kg: f64,
    /// Mass per length of the rail in kg/m.
    pub rail_mass_kg_m: f64,
    /// Static stiffness of the track under one wheel, in N/m.
    pub point_stiffness_n_m: f64,
    /// Track modulus in N/m2: stiffness of railpad and ballast in series, divided by the sleeper spacing.
    pub track_modulus_n_m2: f64,
    /// Contact stiffness under the static load, in N/m.
    pub contact_stiffness_n_m: f64,
    /// Half length of the contact patch, in m.
    pub contact_patch_half_length_m: f64,
    /// Maxima of the rail's receptance above a sleeper, in Hz. The first one is the full-track resonance.
    pub resonances_at_sleeper_hz: Vec<f64>,
    /// Maxima of the rail's receptance at midspan, in Hz.
    pub resonances_at_midspan_hz: Vec<f64>,
    /// First pinned–pinned frequency in Hz: half a bending wavelength per span, with nodes at the sleepers.
    pub pinned_pinned_hz: f64,
    /// P2 frequency in Hz: resonance of the wheel on the track stiffness; `None` if none was found.
    pub p2_hz: Option<f64>,
    /// One-third-octave levels of the surface, with the limits of ISO 3095.
    pub surface: Vec<SurfaceLevel>,
    /// Properties at each speed.
    pub speeds: Vec<AtSpeed>,
    /// Sensitivity of the level to each parameter.
    pub parameters: Vec<Tellable>,
    /// E I of the described sleeper section divided by the nominal bending stiffness.
    pub sleeper_section_ratio: f64,
    /// Length of a half sleeper divided by the distance of the rail seat from the middle; `None` if the seat is there.
    pub half_length_ratio: Option<f64>,
    /// Radius of the wheel divided by the sleeper spacing.
    pub wheel_radius_ratio: f64,
}

/// Level of the surface in one one-third octave.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct SurfaceLevel {
    /// Wavelength at the centre, in m.
    pub wavelength_m: f64,
    /// Level in dB re 1 um.
    pub level_db: f64,
    /// Limit of ISO 3095:2013 in dB re 1 um.
    pub limit_db: f64,
}

/// Properties at one speed.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct AtSpeed {
    /// Speed in km/h.
    pub speed_km_h: f64,
    /// Sleeper-passing frequency in Hz.
    pub sleeper_passing_hz: f64,
    /// Standard deviation of the contact force, divided by the static load.
    pub force_ratio: f64,
    /// Share of the time without contact, 0 to 1, for a normally distributed contact force.
    pub without_contact: f64,
}

/// Sensitivity of the acceleration level to one parameter.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Tellable {
    /// The parameter.
    pub parameter: Parameter,
    /// Largest change of the level in dB, for a 10 % larger parameter value.
    pub change_db: f64,
    /// Frequency in Hz of the largest change; `None` if the change is equal at all frequencies.
    pub at_hz: Option<f64>,
}

/// Reasons for not checking a track.
#[derive(Debug, thiserror::Error)]
pub enum CheckError {
    /// The track model cannot be built.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// The receptance of the track cannot be computed.
    #[error(transparent)]
    Frequency(#[from] FrequencyError),
}

/// Response of the track at the frequencies of the check, above a sleeper and at midspan.
struct Response {
    rail: [Vec<Complex64>; 2],
    /// Amplitude of the contact force per amplitude of the surface, in N/m.
    force: [Vec<f64>; 2],
}

impl Response {
    fn new(track: &Track, set: &ParameterSet, frequencies: &[f64]) -> Result<Self, CheckError> {
        let model = model(track, set)?;
        let spacing_m = track.design.sleeper.spacing_m;
        let middle_m = (SPANS / 2) as f64 * spacing_m;
        let at = |x_m: f64| {
            let place = ReceptancePoint::Rail(x_m);
            receptance(&model, place, place, frequencies)
        };
        let rail = [at(middle_m)?, at(middle_m + 0.5 * spacing_m)?];
        let hertz = contact_stiffness(track);
        let force = |rail: &Vec<Complex64>| {
            let each = rail.iter().zip(frequencies);
            each.map(|(rail, hz)| {
                let wheel = model.vehicle().receptance(TAU * hz);
                (1.0 / hertz + wheel + rail).inv().norm()
            })
            .collect()
        };
        let force = [force(&rail[0]), force(&rail[1])];
        Ok(Self { rail, force })
    }

    /// Mean over both points of the squared contact force per surface amplitude.
    fn power(&self, line: usize) -> f64 {
        0.5 * (self.force[0][line].powi(2) + self.force[1][line].powi(2))
    }
}

/// Computes the properties of a described track.
///
/// # Errors
/// Returns [`CheckError`] if the description does not define a valid track model.
pub fn check(track: &Track) -> Result<TrackCheck, CheckError> {
    let design = &track.design;
    let frequencies = frequencies(design.length_ratio());
    let nominal = Response::new(track, &track.nominal, &frequencies)?;
    let still = Response::new(track, &track.nominal, &[STATIC_HZ])?;
    let resonances = |rail: &[Complex64]| {
        let magnitudes: Vec<f64> = rail.iter().map(|value| value.norm()).collect();
        let maxima = peaks(&frequencies, &magnitudes, PROMINENCE_DB);
        maxima.iter().map(|peak| peak.frequency_hz).collect::<Vec<_>>()
    };
    let force = peaks(&frequencies, &nominal.force[0], PROMINENCE_DB);
    let [railpad, ballast] =
        [Parameter::RailpadStiffness, Parameter::BallastStiffness].map(|it| track.nominal[it]);
    let parameters = Parameter::ALL
        .iter()
        .map(|&parameter| tellable(track, parameter, &frequencies, &nominal))
        .collect::<Result<_, _>>()?;
    Ok(TrackCheck {
        name: track.name.clone(),
        half_sleeper_mass_kg: design.sleeper_mass(),
        rail_mass_kg_m: design.rail.mass_per_length(),
        point_stiffness_n_m: 1.0 / still.rail[0][0].norm(),
        track_modulus_n_m2: 1.0 / (1.0 / railpad + 1.0 / ballast) / design.sleeper.spacing_m,
        contact_stiffness_n_m: contact_stiffness(track),
        contact_patch_half_length_m: ContactPatch::new(design).half_length_m,
        resonances_at_sleeper_hz: resonances(&nominal.rail[0]),
        resonances_at_midspan_hz: resonances(&nominal.rail[1]),
        pinned_pinned_hz: pinned_pinned_hz(design),
        p2_hz: force.first().map(|peak| peak.frequency_hz),
        surface: ISO_3095.map(|limit| surface_level(track, limit)).to_vec(),
        speeds: track
            .speeds_km_h
            .iter()
            .map(|&speed| at_speed(track, speed, &frequencies, &nominal))
            .collect::<Result<_, _>>()?,
        parameters,
        sleeper_section_ratio: design.sleeper.section.bending_stiffness()
            / track.nominal[Parameter::SleeperBendingStiffness],
        half_length_ratio: (design.sleeper.rail_seat_m > 0.0)
            .then(|| design.sleeper.half_length_m / design.sleeper.rail_seat_m),
        wheel_radius_ratio: design.wheel.radius_m / design.sleeper.spacing_m,
    })
}

/// First frequency in Hz of a Timoshenko beam of one span on pins, in closed form: the lower root of
/// `rho I rho A w^4 - (rho A (k^2 E I + kappa G A) + k^2 rho I kappa G A) w^2 + k^4 E I kappa G A = 0` with
/// `k = pi / spacing`.
///
/// Source: S. P. Timoshenko, Philosophical Magazine 41 (1921).
fn pinned_pinned_hz(design: &TrackDesign) -> f64 {
    let (rail, wave_number) = (&design.rail, PI / design.sleeper.spacing_m);
    let [bending, shear] = [rail.bending_stiffness(), rail.shear_stiffness()];
    let [mass, rotary] = [rail.mass_per_length(), rail.rotary_inertia_per_length()];
    let square = wave_number.powi(2);
    let quadratic = rotary * mass;
    let linear = mass * (square * bending + shear) + square * rotary * shear;
    let constant = square.powi(2) * bending * shear;
    let root = (linear.powi(2) - 4.0 * quadratic * constant).sqrt();
    (0.5 * (linear - root) / quadratic).sqrt() / TAU
}

fn frequencies(length_ratio: f64) -> Vec<f64> {
    let [first, last] = FREQUENCIES_HZ.map(|hz| hz / length_ratio);
    let count = (PER_OCTAVE * (last / first).log2()).ceil() as usize;
    (0..=count).map(|line| first * (line as f64 / PER_OCTAVE).exp2()).collect()
}

fn model(track: &Track, set: &ParameterSet) -> Result<TrackModel, ModelError> {
    let supports = vec![Support::from(set); SPANS - 1];
    let mesh = Mesh::uniform(SPANS, ELEMENTS, ELEMENTS);
    TrackModel::build(&track.design, &mesh, &supports, &[])
}

/// Derivative of the contact force with respect to the approach, under the static load.
fn contact_stiffness(track: &Track) -> f64 {
    HertzContact::new(&track.design).stiffness(track.design.wheel.load_n)
}

fn roughness(track: &Track) -> Roughness {
    Roughness::between(track.nominal[Parameter::IrregularityLevel], track.wavelengths_m)
}

/// Level of eq. B.6 in a one-third octave, whose width is 0.2316 of its centre.
fn surface_level(track: &Track, (wavelength_m, limit_db): (f64, f64)) -> SurfaceLevel {
    let width = 10f64.powf(0.05) - 10f64.powf(-0.05);
    let wave_number = TAU / wavelength_m;
    let square_m2 = roughness(track).density(wave_number) * width * wave_number;
    SurfaceLevel { wavelength_m, level_db: 10.0 * (square_m2 / 1e-12).log10(), limit_db }
}

fn at_speed(
    track: &Track,
    speed_km_h: f64,
    frequencies: &[f64],
    nominal: &Response,
) -> Result<AtSpeed, ModelError> {
    let speed_m_s = speed_km_h / 3.6;
    let (surface, model) = (roughness(track), model(track, &track.nominal)?);
    let step = std::f64::consts::LN_2 / PER_OCTAVE;
    let line = |(number, hz): (usize, &f64)| {
        let wave_number = TAU * hz / speed_m_s;
        let density = surface.density(wave_number) * model.roughness_gain(wave_number);
        density * wave_number * step * nominal.power(number)
    };
    let variance: f64 = frequencies.iter().enumerate().map(line).sum();
    let force_ratio = variance.sqrt() / track.design.wheel.load_n;
    Ok(AtSpeed {
        speed_km_h,
        sleeper_passing_hz: speed_m_s / track.design.sleeper.spacing_m,
        force_ratio,
        without_contact: 0.5 * libm::erfc(1.0 / (SQRT_2 * force_ratio)),
    })
}

/// Computes the sensitivity of the level to a parameter, in one-sixth octaves.
fn tellable(
    track: &Track,
    parameter: Parameter,
    frequencies: &[f64],
    nominal: &Response,
) -> Result<Tellable, CheckError> {
    if parameter == Parameter::IrregularityLevel {
        // The level multiplies the power at all frequencies.
        let change_db = 10.0 * (1.0 + CHANGE).log10();
        return Ok(Tellable { parameter, change_db, at_hz: None });
    }
    let set = track.nominal.with(parameter, track.nominal[parameter] * (1.0 + CHANGE));
    let changed = Response::new(track, &set, frequencies)?;
    let band = (PER_OCTAVE / 6.0) as usize;
    let sum = |response: &Response, first: usize| -> f64 {
        (first..first + band).map(|line| response.power(line)).sum()
    };
    let bands = (0..=frequencies.len() - band).step_by(band);
    let changes = bands.map(|first| {
        let change_db = 10.0 * (sum(&changed, first) / sum(nominal, first)).log10();
        (change_db, frequencies[first + band / 2])
    });
    let greatest = changes.max_by(|a, b| a.0.abs().total_cmp(&b.0.abs()));
    let (change_db, at_hz) = greatest.unwrap_or((0.0, frequencies[0]));
    Ok(Tellable { parameter, change_db, at_hz: Some(at_hz) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use tracktwin_parameters::Preset;

    /// Ranges of published tracks (Knothe and Grassie 1993; Thompson 2009): full-track resonance 40 to
    /// 140 Hz, P2 30 to 100 Hz, pinned-pinned of 60E1 at 0.6 m near 1070 Hz.
    #[test]
    fn a_line_resonates_where_published_tracks_do() {
        let check = check(&Preset::Concrete60E1.track()).unwrap();
        let full_track_hz = check.resonances_at_sleeper_hz[0];
        assert!((40.0..140.0).contains(&full_track_hz), "{full_track_hz}");
        let p2_hz = check.p2_hz.unwrap();
        assert!((30.0..100.0).contains(&p2_hz), "{p2_hz}");
        assert!((1050.0..1085.0).contains(&check.pinned_pinned_hz), "{}", check.pinned_pinned_hz);
        // The model has it at midspan.
        let nearest = |hz: &f64| (hz / check.pinned_pinned_hz).ln().abs();
        let found = check.resonances_at_midspan_hz.iter().map(nearest).fold(1.0, f64::min);
        assert!(found < 0.02, "{:?}", check.resonances_at_midspan_hz);
        let stiffness = 1e-6 * check.point_stiffness_n_m;
        assert!((60.0..264.0).contains(&stiffness), "{stiffness}");
    }

    #[test]
    fn the_surface_of_a_reference_track_has_the_limit_s_level() {
        let mut track = Preset::Concrete60E1.track();
        track.nominal[Parameter::IrregularityLevel] = 0.19;
        let at_10_cm = surface_level(&track, (0.1, 4.9));
        assert!((at_10_cm.level_db - 4.9).abs() < 0.2, "{at_10_cm:?}");
    }
}
