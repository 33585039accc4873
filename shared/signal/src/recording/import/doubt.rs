//! Doubts about the assumed unit and direction of an acceleration column.

use super::column::Column;
use super::unit::{AccelerationUnit, Unit};
use tracktwin_number::significant;

/// Relative difference of a constant from gravity below which it is gravity.
const GRAVITY: f64 = 0.03;
/// Values from which on whole numbers are no measured accelerations by chance.
const WHOLE_MIN: usize = 100;

/// Doubts about values that are taken in `unit`, positive upwards or not: a sentence each.
pub(super) fn of_acceleration(
    column: &Column,
    unit: AccelerationUnit,
    upwards: bool,
) -> Vec<String> {
    let Column { name, values, .. } = column;
    if unit == AccelerationUnit::Unknown {
        return Vec::new();
    }
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let is_near = |constant: f64| (mean.abs() / constant - 1.0).abs() < GRAVITY;
    let g = AccelerationUnit::G.in_si();
    let shown = significant(mean, 3);
    let mut doubts = Vec::new();
    let (other, of_other, own) = match unit {
        AccelerationUnit::G => ("m/s2", g, 1.0),
        _ => ("g", 1.0, g),
    };
    if is_near(of_other) {
        doubts.push(format!(
            "doubt: {name}: the mean of {shown} would be gravity in {other}, but {} is assumed; \
                 if the unit is {other}, use --unit {other}",
            unit.name()
        ));
    } else if is_near(own) && (mean > 0.0) != upwards {
        let (is, say) =
            if upwards { ("downwards", "omit --upwards") } else { ("upwards", "use --upwards") };
        doubts.push(format!(
            "doubt: {name}: the mean of {shown} {} looks like gravity on a sensor that is \
                 positive {is}; if so, {say}",
            unit.name()
        ));
    }
    if values.len() >= WHOLE_MIN && values.iter().all(|value| value.fract() == 0.0) {
        doubts.push(format!(
            "doubt: {name}: all values are integers, like the counts of an A/D converter; if \
                 so, use --unit unknown, or convert the values to m/s2"
        ));
    }
    doubts
}

#[cfg(test)]
mod tests {
    use super::*;

    fn doubts(offset: f64, unit: AccelerationUnit, upwards: bool) -> String {
        let values = (0..500).map(|i| offset + (f64::from(i) * std::f64::consts::TAU / 50.0).sin());
        let column =
            Column { name: "acc".to_owned(), values: values.collect(), ..Column::default() };
        of_acceleration(&column, unit, upwards).join("\n")
    }

    #[test]
    fn gravity_tells_unit_and_direction() {
        use AccelerationUnit::{G, MetrePerSecondSquared as Si, Unknown};
        assert!(doubts(1.0, Si, false).contains("gravity in g"));
        assert!(doubts(-9.81, G, false).contains("gravity in m/s2"));
        assert!(doubts(9.81, Si, false).contains("use --upwards"));
        assert!(doubts(-1.0, G, true).contains("omit --upwards"));
        for (offset, unit, upwards) in
            [(-9.81, Si, false), (9.8, Si, true), (0.3, Si, false), (1.0, Unknown, false)]
        {
            assert_eq!(doubts(offset, unit, upwards), "", "{offset}");
        }
    }

    #[test]
    fn whole_numbers_are_taken_for_counts() {
        let values = (0..500).map(|i| f64::from(i * 37 % 101)).collect();
        let column = Column { values, ..Column::default() };
        let doubts = of_acceleration(&column, AccelerationUnit::MetrePerSecondSquared, false);
        assert!(doubts[0].contains("counts of an A/D converter"), "{doubts:?}");
    }
}
