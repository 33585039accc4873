//! Pictures as plain data. The page defines their appearance.

use tracktwin_signal::TimeFrequencyMap;

/// A chart: curves over two axes.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Title of the picture.
    pub title: String,
    /// The horizontal axis.
    pub x: Scale,
    /// The vertical axis.
    pub y: Scale,
    /// Curves, in the order of drawing.
    pub curves: Vec<Curve>,
    /// Positions and names on the horizontal axis, instead of numbers.
    pub names: Vec<(f64, String)>,
    /// Positions on the horizontal axis with a thin vertical line.
    pub marks: Vec<f64>,
    /// Whether the picture has the full width of the page.
    pub wide: bool,
}

/// An axis.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Scale {
    /// Quantity of the axis, with its unit.
    pub label: String,
    /// Whether the axis is logarithmic; otherwise it is linear.
    pub logarithmic: bool,
}

/// Points of one kind.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// Name in the legend. Empty: no entry.
    pub name: String,
    /// Style of drawing.
    pub style: Style,
    /// Points of the curve, as (x, y).
    pub points: Vec<(f64, f64)>,
}

/// Style of drawing of a curve.
#[derive(Clone, Debug, PartialEq)]
pub enum Style {
    /// As a line in a colour of its own.
    Line,
    /// As a line in the colour of the text, for the truth.
    Truth,
    /// As a thin line, one of many of the same kind.
    Thin,
    /// As a line with a band of this half-width about it.
    Band(Vec<f64>),
    /// As many small dots.
    Dots,
    /// As a few larger dots.
    Points,
    /// As bars from zero.
    Bars,
    /// As a map of magnitudes in dB. The points are the lower left and the upper right corner of the
    /// map.
    Map(TimeFrequencyMap),
}

impl Scale {
    pub(crate) fn linear(label: impl Into<String>) -> Self {
        Self { label: label.into(), logarithmic: false }
    }

    pub(crate) fn logarithmic(label: impl Into<String>) -> Self {
        Self { label: label.into(), logarithmic: true }
    }
}

impl Picture {
    pub(crate) fn new(title: impl Into<String>, x: Scale, y: Scale) -> Self {
        let (curves, names, marks) = (Vec::new(), Vec::new(), Vec::new());
        Self { title: title.into(), x, y, curves, names, marks, wide: false }
    }

    /// A wide chart of bars from zero: at each of the `places` a bar a kind, with `values` in the
    /// order of the places.
    pub(crate) fn bars(
        title: impl Into<String>,
        y: &str,
        places: &[&str],
        kinds: impl IntoIterator<Item = (String, Vec<f64>)>,
    ) -> Self {
        let mut picture = Self::new(title, Scale::linear(""), Scale::linear(y));
        picture.wide = true;
        for (name, values) in kinds {
            let points = values.into_iter().enumerate().map(|(at, value)| (at as f64, value));
            picture = picture.with(name, Style::Bars, points.collect());
        }
        let places = places.iter().enumerate();
        picture.names = places.map(|(at, &place)| (at as f64, place.to_owned())).collect();
        picture
    }

    /// The same with a curve more.
    #[must_use]
    pub(crate) fn with(
        mut self,
        name: impl Into<String>,
        style: Style,
        points: Vec<(f64, f64)>,
    ) -> Self {
        self.curves.push(Curve { name: name.into(), style, points });
        self
    }
}
