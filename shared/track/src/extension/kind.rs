//! Definition of a kind of extension: name, class, place, parameters, and the function that builds it.

use super::{Extension, Inputs, InstanceError, Screening, registry};
use std::sync::Arc;
use tracktwin_parameters::Quantity;

/// Relative standard deviations of depths and lengths of shapes whose form is assumed: differences between
/// fits and truths of five defects that other simulators made with forms of their own were up to 26 %.
pub(super) const DEPTH_DEVIATION: f64 = 0.2;
pub(super) const LENGTH_DEVIATION: f64 = 0.15;

/// Largest allowed ratio between a parameter and the ends of its expected range.
const SIZE: f64 = 1e3;

/// Ratio of lengths to V-Track from which a track counts as real scale: the geometric mean of 1 and 8.
const REAL_RATIO: f64 = 2.8;

/// Largest seed: an `f64` represents all whole numbers up to this value exactly.
const SEED_MAX: f64 = 9_007_199_254_740_992.0;

/// A kind of extension: one row of the registry.
#[derive(Debug)]
pub struct Kind {
    /// Name of the kind in files, on the command line and in the library.
    pub physics: &'static str,
    /// Description of the kind: one sentence without a full stop.
    pub summary: &'static str,
    /// The part of track, vehicle or measurement that the kind belongs to.
    pub family: EffectFamily,
    /// Group of look-alike kinds, which the diagnosis weighs as one first.
    pub group: LookAlikeGroup,
    /// How the signature depends on speed, place and load.
    pub classes: &'static [Class],
    /// Form of place that the kind requires.
    pub place: PlaceKind,
    /// Whether the kind is a fault of the measuring chain and not physics of vehicle or track.
    pub measuring_chain: bool,
    /// Parameters of the kind.
    pub parameters: &'static [KindParameter],
    /// Names of kinds that predict nearly the same features.
    pub look_alikes: &'static [&'static str],
    /// Measurement that separates the kind from its look-alikes.
    pub would_separate: &'static str,
    /// How the diagnosis searches a recording for the kind.
    pub screening: Screening,
    /// Builds the extension from inputs that the registry has checked.
    pub build: fn(&Inputs<'_>) -> Result<Arc<dyn Extension>, InstanceError>,
}

/// Family of a kind: the part of track, vehicle or measurement that differs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EffectFamily {
    /// Support of the sleepers: lost, soft or layered.
    Support,
    /// Railpads, clamps and bolts.
    Fastening,
    /// Bending of the rail: joint, weld, cross section.
    RailBending,
    /// Shape of the rail's surface at a place: squat.
    SurfaceShape,
    /// Waves on the rail's surface, and how the contact filters them.
    SurfaceWaves,
    /// The wheel's circumference.
    Wheel,
    /// The vehicle around the wheel.
    Vehicle,
    /// Sensor, mounting and recorder.
    Sensor,
    /// Clock and odometer.
    Position,
    /// Track structure that no kind in the catalogue explains.
    UnknownStructure,
    /// A surface of the rail that no kind explains.
    UnknownSurface,
    /// Something at the wheel that no kind explains.
    UnknownWheel,
}

impl EffectFamily {
    /// Name of the family in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Support => "support",
            Self::Fastening => "fastening",
            Self::RailBending => "rail_bending",
            Self::SurfaceShape => "surface_shape",
            Self::SurfaceWaves => "surface_waves",
            Self::Wheel => "wheel",
            Self::Vehicle => "vehicle",
            Self::Sensor => "sensor",
            Self::Position => "position",
            Self::UnknownStructure => "unknown_structure",
            Self::UnknownSurface => "unknown_surface",
            Self::UnknownWheel => "unknown_wheel",
        }
    }

    /// Phrase for the effect of left-out physics of this family, for use in a sentence.
    pub const fn words(self) -> &'static str {
        match self {
            Self::Support => "a support of sleepers that is lost, soft or layered",
            Self::Fastening => "another fastening",
            Self::RailBending => "another bending stiffness of the rail",
            Self::SurfaceShape => "a shape of the rail's surface",
            Self::SurfaceWaves => "waves on the rail's surface",
            Self::Wheel => "a wheel that is not round",
            Self::Vehicle => "something on the vehicle",
            Self::Sensor => "a fault of sensor or recorder",
            Self::Position => "wrong positions",
            Self::UnknownStructure => "something in the track",
            Self::UnknownSurface => "something on the rail's surface",
            Self::UnknownWheel => "something at the wheel",
        }
    }
}

/// Group of kinds that a recording separates less reliably than other kinds. The diagnosis weighs each
/// group as one first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LookAlikeGroup {
    /// A defect of the rail at a place: joint, weld, squat.
    RailDefect,
    /// The surface of the rail over a stretch or along the whole track.
    RailSurface,
    /// The rail's cross section.
    RailSection,
    /// The contact of wheel and rail.
    Contact,
    /// The wheel's circumference.
    Wheel,
    /// The vehicle around the wheel.
    Vehicle,
    /// Rail fastening and railpad.
    Fastening,
    /// Parts that hold the sleepers down.
    HoldDown,
    /// Support under the sleepers: lost, soft or layered.
    Support,
    /// Sensor, mounting, clock, odometer.
    MeasuringChain,
}

/// How the signature of a kind changes between passes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Class {
    /// Fixed in frequency when the speed changes.
    Frequency,
    /// Fixed in wavelength: moves in frequency with the speed.
    Wavelength,
    /// Tied to a place of the track.
    Local,
    /// The same at every place.
    Global,
    /// Tied to the wheel's angle.
    WheelAngle,
    /// Changes with the wheel load.
    Load,
    /// Concentrated inside a span.
    Concentrated,
    /// Different from pass to pass.
    Noise,
}

impl Class {
    /// Code of the class: F, L, X, G, PHI, W, C or N.
    pub const fn code(self) -> &'static str {
        match self {
            Self::Frequency => "F",
            Self::Wavelength => "L",
            Self::Local => "X",
            Self::Global => "G",
            Self::WheelAngle => "PHI",
            Self::Load => "W",
            Self::Concentrated => "C",
            Self::Noise => "N",
        }
    }
}

/// Form of place that a kind requires.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PlaceKind {
    /// No place: the extension acts on the whole track, the vehicle or the measuring chain.
    Nowhere,
    /// A point of the rail, `x_m = [x, x]`.
    Point,
    /// A stretch of the rail, `x_m = [from, to]`. Without `x_m`: the whole track.
    Stretch,
    /// Sleepers by index. Without indices: all sleepers.
    Sleepers,
}

impl PlaceKind {
    /// Text form of the place, for messages.
    pub const fn form(self) -> &'static str {
        match self {
            Self::Nowhere => "no place",
            Self::Point => "a point of the rail, x_m = [x, x]",
            Self::Stretch => "a stretch of the rail, x_m = [from, to], or none for all of it",
            Self::Sleepers => "sleepers = [numbers, ascending], or none for all of them",
        }
    }
}

/// Numbers that a parameter may have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Bound {
    /// Any finite number.
    Any,
    /// Zero or more.
    NotNegative,
    /// More than zero.
    Positive,
    /// At least zero and less than one.
    Share,
}

impl Bound {
    /// Whether `value` satisfies the bound.
    pub fn holds(self, value: f64) -> bool {
        value.is_finite()
            && match self {
                Self::Any => true,
                Self::NotNegative => value >= 0.0,
                Self::Positive => value > 0.0,
                Self::Share => (0.0..1.0).contains(&value),
            }
    }

    /// Description of the bound, to follow "must be".
    pub const fn form(self) -> &'static str {
        match self {
            Self::Any => "a number",
            Self::NotNegative => "zero or more",
            Self::Positive => "more than zero",
            Self::Share => "at least zero and less than one",
        }
    }
}

/// A parameter of a kind.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KindParameter {
    /// Name of the parameter; ends with the unit.
    pub name: &'static str,
    /// Unit of the parameter, as plain text.
    pub unit: &'static str,
    /// Meaning of the parameter.
    pub meaning: &'static str,
    /// Lowest and highest expected value on V-Track.
    pub v_track: [f64; 2],
    /// Lowest and highest expected value at real scale.
    pub real_scale: [f64; 2],
    /// Typical value on V-Track, from which a search starts.
    pub typical: f64,
    /// Default value on V-Track. `None`: the parameter is required.
    pub default: Option<f64>,
    /// Numbers that the parameter may have.
    pub bound: Bound,
    /// Tolerance outside the range: the largest natural logarithm of the ratio between a value and the end of
    /// its range. A value further outside has a similar effect but belongs to another kind.
    pub slack: f64,
    /// Relative standard deviation of a size that follows from an assumed form. Real defects have other forms.
    pub form_deviation: f64,
}

impl KindParameter {
    /// A required parameter that must be more than zero.
    pub const fn new(name: &'static str, unit: &'static str, meaning: &'static str) -> Self {
        Self {
            name,
            unit,
            meaning,
            v_track: [0.0, 0.0],
            real_scale: [0.0, 0.0],
            typical: 0.0,
            default: None,
            bound: Bound::Positive,
            slack: 1.0,
            form_deviation: 0.0,
        }
    }

    /// Lowest and highest expected value on a track whose lengths are `length_ratio` times those of
    /// V-Track.
    pub const fn range(&self, length_ratio: f64) -> [f64; 2] {
        if length_ratio < REAL_RATIO { self.v_track } else { self.real_scale }
    }

    /// Scales a value from V-Track to a track whose lengths are `length_ratio` times V-Track's. The value
    /// keeps its relative position between the ends of the range, in logarithms. If the value is zero, or if
    /// the range contains zero, it scales with the upper end of the range.
    pub fn scaled(&self, value: f64, length_ratio: f64) -> f64 {
        let (from, to) = (self.v_track, self.range(length_ratio));
        if from == to {
            return value;
        }
        if from[0] > 0.0 && to[0] > 0.0 && value > 0.0 {
            let share = (value / from[0]).ln() / (from[1] / from[0]).ln();
            return to[0] * (to[1] / to[0]).powf(share);
        }
        value * to[1] / from[1]
    }

    /// Default value on a track whose lengths are `length_ratio` times V-Track's: [`scaled`](Self::scaled) unless
    /// it is a pure number. `None`: the parameter is required.
    pub fn default_at(&self, length_ratio: f64) -> Option<f64> {
        let is_number = self.unit == "1";
        self.default.map(|it| if is_number { it } else { self.scaled(it, length_ratio) })
    }

    /// Name, unit and limits of the parameter. The limits are a thousand times, and a thousandth of, the
    /// ends of the expected ranges.
    pub fn quantity(&self) -> Quantity {
        let ends = [self.v_track, self.real_scale].concat();
        let sizes = ends.iter().map(|end| end.abs()).filter(|size| *size > 0.0);
        let most = sizes.clone().fold(0.0, f64::max).max(self.default.unwrap_or(0.0).abs());
        let least = sizes.fold(most, f64::min);
        // A seed: nothing is to be expected of it.
        let most = if self.v_track == [0.0, 0.0] { SEED_MAX } else { SIZE * most };
        let low = match self.bound {
            Bound::Any => -most,
            Bound::NotNegative | Bound::Share => 0.0,
            Bound::Positive => least / SIZE,
        };
        let high = if self.bound == Bound::Share { most.min(1.0) } else { most };
        let usual =
            [ends.iter().copied().fold(high, f64::min), ends.iter().copied().fold(low, f64::max)];
        Quantity::new(self.meaning, self.unit, [low, high], usual)
    }

    /// Sets the expected ranges on V-Track and at real scale, and a typical value on V-Track.
    #[must_use]
    pub const fn ranges(mut self, v_track: [f64; 2], real_scale: [f64; 2], typical: f64) -> Self {
        self.v_track = v_track;
        self.real_scale = real_scale;
        self.typical = typical;
        self
    }

    /// Sets the relative standard deviation of a size that follows from an assumed form.
    #[must_use]
    pub const fn form_deviation(mut self, deviation: f64) -> Self {
        self.form_deviation = deviation;
        self
    }

    /// Sets the slack. Without this call the slack is 1: a factor of e.
    #[must_use]
    pub const fn slack(mut self, slack: f64) -> Self {
        self.slack = slack;
        self
    }

    /// Sets the default value on V-Track. The parameter is then optional.
    #[must_use]
    pub const fn or(mut self, default: f64) -> Self {
        self.default = Some(default);
        self
    }

    /// Sets the bound. Without this call the bound is [`Bound::Positive`].
    #[must_use]
    pub const fn bound(mut self, bound: Bound) -> Self {
        self.bound = bound;
        self
    }
}

impl Kind {
    /// Every kind of the catalogue: physics first, then the measuring chain.
    pub fn all() -> impl Iterator<Item = &'static Self> {
        registry::KINDS.iter().chain(registry::ADDED.get().copied())
    }

    /// The kind with the name `physics`, if there is one.
    pub fn from_name(physics: &str) -> Option<&'static Self> {
        Self::all().find(|kind| kind.physics == physics)
    }

    /// Adds one kind to the catalogue of this process. A process can add only one kind.
    ///
    /// For tests. A permanent kind needs a line in the registry.
    ///
    /// # Errors
    /// Returns `kind` if another kind has already been added.
    #[doc(hidden)]
    pub fn add(kind: &'static Self) -> Result<(), &'static Self> {
        registry::ADDED.set(kind)
    }

    /// The parameter with this name, if the kind has it.
    pub fn parameter(&self, name: &str) -> Option<&'static KindParameter> {
        self.parameters.iter().find(|parameter| parameter.name == name)
    }
}
