//! Definition of a kind of extension: name, class, place, parameters, and the function that builds it.

use super::{Extension, Inputs, InstanceError, KindParameter, Screening, registry};
use std::sync::Arc;

/// Relative standard deviations of depths and lengths of shapes whose form is assumed: differences between
/// fits and truths of five defects that other simulators made with forms of their own were up to 26 %.
pub(super) const DEPTH_DEVIATION: f64 = 0.2;
pub(super) const LENGTH_DEVIATION: f64 = 0.15;

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
