//! Nominal speeds of the passes: passes at about one speed repeat one measurement.

use super::super::Pass;
use tracktwin_number::significant;

/// Ratio of the fastest to the slowest of several passes up to which these have one nominal speed.
const ALIKE: f64 = 1.05;
/// Significant digits of a nominal speed at most.
const DIGITS_MAX: usize = 3;

/// Replaces the mean speeds of the passes by nominal ones: the stated one, or one for all that are alike.
///
/// Passes whose mean speeds differ from their nominal speed by more than rounding are told in `notes`.
pub(super) fn assign(passes: &mut [Pass], stated_km_h: Option<f64>, notes: &mut Vec<String>) {
    let mut order: Vec<usize> = (0..passes.len()).collect();
    order.sort_by(|&a, &b| passes[a].speed_km_h.total_cmp(&passes[b].speed_km_h));
    let speeds: Vec<f64> = order.iter().map(|&index| passes[index].speed_km_h).collect();
    let groups = if stated_km_h.is_some() { vec![speeds.as_slice()] } else { groups(&speeds) };
    let mut rest = order.as_slice();
    for group in groups {
        let (members, others) = rest.split_at(group.len());
        rest = others;
        let nominal = stated_km_h.unwrap_or_else(|| nominal(group));
        let [slowest, fastest] = [group[0], group[group.len() - 1]];
        let shown = |speed| significant(speed, 4);
        if shown(slowest) != shown(fastest)
            || stated_km_h.is_some() && shown(slowest) != shown(nominal)
        {
            let files: Vec<&str> =
                members.iter().map(|&index| passes[index].file.as_str()).collect();
            notes.push(format!(
                "{}: mean speeds from {} to {} km/h are taken as one nominal speed of {nominal} km/h{}",
                files.join(", "),
                shown(slowest),
                shown(fastest),
                if stated_km_h.is_some() { ", as stated" } else { "" }
            ));
        }
        for &index in members {
            passes[index].speed_km_h = nominal;
        }
    }
}

/// Groups of ascending speeds that are alike; where they are not, they are parted at the greatest ratio.
fn groups(speeds: &[f64]) -> Vec<&[f64]> {
    let [first, .., last] = speeds else { return vec![speeds] };
    if last / first <= ALIKE {
        return vec![speeds];
    }
    let ratio = |&index: &usize| speeds[index] / speeds[index - 1];
    let widest = (1..speeds.len()).max_by(|a, b| ratio(a).total_cmp(&ratio(b)));
    let (slower, faster) = speeds.split_at(widest.unwrap_or(1));
    [groups(slower), groups(faster)].concat()
}

/// The mean with as few digits as leave it among the speeds of the group.
fn nominal(group: &[f64]) -> f64 {
    let mean = group.iter().sum::<f64>() / group.len() as f64;
    let with = |digits: usize| format!("{mean:.*e}", digits - 1).parse::<f64>().unwrap_or(mean);
    let range = group[0]..=group[group.len() - 1];
    let fewest = (1..DIGITS_MAX).map(with).find(|speed| range.contains(speed));
    fewest.unwrap_or_else(|| with(DIGITS_MAX))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Signal;

    fn assigned(speeds: &[f64], stated_km_h: Option<f64>) -> (Vec<f64>, Vec<String>) {
        let pass = |(index, &speed_km_h): (usize, &f64)| Pass {
            file: format!("{index}.csv"),
            speed_km_h,
            axle: None,
            signal: Signal::new(1e3, vec![0.0; 2]).unwrap(),
            position_m: vec![0.0, 1.0],
            contact_loss_share: None,
        };
        let mut passes: Vec<Pass> = speeds.iter().enumerate().map(pass).collect();
        let mut notes = Vec::new();
        assign(&mut passes, stated_km_h, &mut notes);
        (passes.iter().map(|pass| pass.speed_km_h).collect(), notes)
    }

    #[test]
    fn passes_at_about_one_speed_get_one_nominal_speed_that_is_told() {
        let (speeds, notes) = assigned(&[60.9, 79.4, 59.2, 81.1, 39.26, 80.3], None);
        assert_eq!(speeds, [60.0, 80.0, 60.0, 80.0, 39.3, 80.0]);
        assert_eq!(notes.len(), 2, "{notes:?}");
        let said = "2.csv, 0.csv: mean speeds from 59.20 to 60.90 km/h are taken as one nominal \
                    speed of 60 km/h";
        assert_eq!(notes[0], said);
        // One that is nearer to none of the others keeps its own.
        let (speeds, _) = assigned(&[95.3, 100.0, 100.2, 100.4], None);
        assert_eq!(speeds, [95.3, 100.0, 100.0, 100.0]);
    }

    #[test]
    fn a_stated_speed_is_that_of_all_passes() {
        let (speeds, notes) = assigned(&[61.0, 64.2], Some(62.5));
        assert_eq!(speeds, [62.5, 62.5]);
        assert!(notes[0].ends_with("one nominal speed of 62.5 km/h, as stated"), "{notes:?}");
        assert_eq!(assigned(&[62.500_001, 62.5], Some(62.5)), (vec![62.5; 2], Vec::new()));
    }
}
