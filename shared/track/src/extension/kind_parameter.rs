//! A parameter of a kind of extension: unit, expected ranges, bound and default.

use tracktwin_parameters::{Parameter, Quantity};

/// Largest allowed ratio between a parameter and the ends of its expected range.
const SIZE: f64 = 1e3;

/// Ratio of lengths to V-Track from which a track counts as real scale: the geometric mean of 1 and 8.
const REAL_RATIO: f64 = 2.8;

/// Largest seed: an `f64` represents all whole numbers up to this value exactly.
const SEED_MAX: f64 = 9_007_199_254_740_992.0;

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
    /// A whole number above zero.
    Whole,
    /// Zero or one.
    Choice,
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
                Self::Whole => value > 0.0 && value.fract() == 0.0,
                Self::Choice => value == 0.0 || value == 1.0,
            }
    }

    /// Description of the bound, to follow "must be".
    pub const fn form(self) -> &'static str {
        match self {
            Self::Any => "a number",
            Self::NotNegative => "zero or more",
            Self::Positive => "more than zero",
            Self::Share => "at least zero and less than one",
            Self::Whole => "a whole number above zero",
            Self::Choice => "0 or 1",
        }
    }

    /// Whether every number between two that satisfy the bound satisfies it.
    pub const fn is_continuous(self) -> bool {
        !matches!(self, Self::Whole | Self::Choice)
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
    /// Parameter of the track that it replaces at the sleepers of the extension.
    pub replaces: Option<Parameter>,
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
            replaces: None,
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
            Bound::NotNegative | Bound::Share | Bound::Choice => 0.0,
            Bound::Positive | Bound::Whole => least / SIZE,
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

    /// Sets the parameter of the track that it replaces at the sleepers of the extension.
    #[must_use]
    pub const fn replaces(mut self, parameter: Parameter) -> Self {
        self.replaces = Some(parameter);
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
