//! Tables of signals: force and acceleration of several hits, averaged to receptances.

use super::{ReadError, ReadFault, Rows};
use crate::PointReceptance;
use num_complex::Complex64;
use std::f64::consts::TAU;
use tracktwin_parameters::quantity::PLACE;

/// The column that identifies a table of signals.
pub(super) const TIME: &str = "time_s";

/// Columns; only the hit number is optional.
const COLUMNS: &[&str] = &["position_m", TIME, "force_N", "acceleration_m_s2", "hit"];
const REQUIRED: usize = 4;

/// Smallest number of samples of a hit.
const SAMPLES_MIN: usize = 64;

/// Smallest length of a hit, as a share of the median length at its place.
const LENGTH_SHARE: f64 = 0.9;

/// Largest relative difference between the mean time steps of two hits.
const UNEVEN_MAX: f64 = 1e-3;
/// A time step that differs from the median step by more than this share is a gap; smaller differences come
/// from rounded times.
const GAP: f64 = 0.5;

/// One hit.
struct Hit {
    position_m: f64,
    number: Option<f64>,
    /// Line number of the first sample.
    line: u64,
    times_s: Vec<f64>,
    force_n: Vec<f64>,
    acceleration_m_s2: Vec<f64>,
}

/// Reads the hits and averages consecutive hits at one position. A new hit begins where the time does not
/// increase, or where the hit number or the position changes.
pub(super) fn read(text: &str) -> Result<Vec<PointReceptance>, ReadError> {
    let mut hits: Vec<Hit> = Vec::new();
    Rows::new(text, COLUMNS, REQUIRED)?.each(|line, row| {
        let &[Some(position_m), Some(time_s), Some(force_n), Some(acceleration), number] = row
        else {
            unreachable!("the columns are there")
        };
        PLACE.check(position_m)?;
        let goes_on = |hit: &Hit| {
            let is_later = hit.times_s.last().is_some_and(|last| time_s > *last);
            is_later && hit.position_m == position_m && hit.number == number
        };
        if !hits.last().is_some_and(goes_on) {
            hits.push(Hit {
                position_m,
                number,
                line,
                times_s: Vec::new(),
                force_n: Vec::new(),
                acceleration_m_s2: Vec::new(),
            });
        }
        let hit = hits.last_mut().expect("one was added");
        hit.times_s.push(time_s);
        hit.force_n.push(force_n);
        hit.acceleration_m_s2.push(acceleration);
        Ok(())
    })?;
    if hits.is_empty() {
        let remedy = "write a row a sample below the names of the columns";
        return Err(ReadError { line: 1, fault: ReadFault::Nothing { remedy } });
    }
    hits.chunk_by(|a, b| a.position_m == b.position_m).map(average).collect()
}

/// Receptance of several hits: `H1 = G_fa / G_ff` summed over the hits, divided by `-w^2`, with the
/// coherence `|G_fa|^2 / (G_ff G_aa)` (Bendat and Piersol, *Random Data*, 4th ed., section 6.1).
///
/// A hit is transformed as a whole, without a window function, because its record begins and ends at rest.
fn average(hits: &[Hit]) -> Result<PointReceptance, ReadError> {
    let step_s = step(hits)?;
    check_lengths(hits)?;
    let samples = hits.iter().map(|hit| hit.force_n.len()).min().unwrap_or_default();
    let transform = tracktwin_fourier::real_forward(samples);
    let spectrum = |signal: &[f64]| {
        let mean = signal[..samples].iter().sum::<f64>() / samples as f64;
        let mut input: Vec<f64> = signal[..samples].iter().map(|value| value - mean).collect();
        let mut output = transform.make_output_vec();
        transform.process(&mut input, &mut output).expect("the lengths are the plan's");
        output
    };
    let lines = samples / 2 + 1;
    let (mut force, mut response) = (vec![0.0; lines], vec![0.0; lines]);
    let mut cross = vec![Complex64::ZERO; lines];
    for hit in hits {
        let (f, a) = (spectrum(&hit.force_n), spectrum(&hit.acceleration_m_s2));
        for line in 0..lines {
            force[line] += f[line].norm_sqr();
            response[line] += a[line].norm_sqr();
            cross[line] += f[line].conj() * a[line];
        }
    }
    if force[1..].iter().all(|power| *power == 0.0) {
        return Err(ReadError { line: hits[0].line, fault: ReadFault::NoForce });
    }
    if cross[1..].iter().all(|product| *product == Complex64::ZERO) {
        return Err(ReadError { line: hits[0].line, fault: ReadFault::NoResponse });
    }
    let mut point = PointReceptance {
        position_m: hits[0].position_m,
        frequencies_hz: Vec::new(),
        values: Vec::new(),
        // The coherence of a single hit is one, whatever its noise.
        coherence: (hits.len() > 1).then(Vec::new),
        hits: Some(hits.len()),
    };
    // The mean and the highest line of a real signal say nothing, nor does a line without product.
    let is_usable = |line: &usize| {
        force[*line] > 0.0 && response[*line] > 0.0 && cross[*line] != Complex64::ZERO
    };
    for line in (1..lines.saturating_sub(1)).filter(is_usable) {
        let frequency_hz = line as f64 / (samples as f64 * step_s);
        let omega = TAU * frequency_hz;
        point.frequencies_hz.push(frequency_hz);
        point.values.push(cross[line] / force[line] / (-omega * omega));
        if let Some(coherence) = &mut point.coherence {
            let value = cross[line].norm_sqr() / (force[line] * response[line]);
            coherence.push(value.min(1.0));
        }
    }
    Ok(point)
}

/// Refuses a hit that is much shorter than the others at its place: all would be cut to its length.
fn check_lengths(hits: &[Hit]) -> Result<(), ReadError> {
    let mut lengths: Vec<usize> = hits.iter().map(|hit| hit.force_n.len()).collect();
    lengths.sort_unstable();
    let least = (LENGTH_SHARE * lengths[lengths.len() / 2] as f64) as usize;
    match hits.iter().find(|hit| hit.force_n.len() < least) {
        Some(hit) => {
            let fault = ReadFault::CutHit { samples: hit.force_n.len(), least };
            Err(ReadError { line: hit.line, fault })
        }
        None => Ok(()),
    }
}

/// The common time step of the hits in s.
fn step(hits: &[Hit]) -> Result<f64, ReadError> {
    let mut first = None;
    for hit in hits {
        let samples = hit.times_s.len();
        if samples < SAMPLES_MIN {
            let fault = ReadFault::ShortHit { samples, least: SAMPLES_MIN };
            return Err(ReadError { line: hit.line, fault });
        }
        let steps = || hit.times_s.windows(2).map(|pair| pair[1] - pair[0]);
        let mut sorted: Vec<f64> = steps().collect();
        sorted.sort_by(f64::total_cmp);
        let usual_s = sorted[sorted.len() / 2];
        let is_gap = |step_s: f64| (step_s / usual_s - 1.0).abs() > GAP;
        if let Some((line, step_s)) = (hit.line + 1..).zip(steps()).find(|it| is_gap(it.1)) {
            return Err(ReadError { line, fault: ReadFault::UnevenTime { step_s, usual_s } });
        }
        let mean_s = (hit.times_s[samples - 1] - hit.times_s[0]) / (samples - 1) as f64;
        let first_s = *first.get_or_insert(mean_s);
        if (mean_s / first_s - 1.0).abs() > UNEVEN_MAX {
            let fault = ReadFault::UnevenTime { step_s: mean_s, usual_s: first_s };
            return Err(ReadError { line: hit.line, fault });
        }
    }
    Ok(first.expect("there is a hit"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fmt::Write as _;

    const STEP_S: f64 = 1e-3;
    const SAMPLES: usize = 1024;

    /// Signals of an oscillator `m a + c v + k u = f` with a mass of 1 kg, for `hits` hits. The noise is a
    /// sine that differs from hit to hit.
    fn signals(hits: usize, noise: f64) -> String {
        let (m, c, k) = (1.0, 20.0, 1e4);
        let mut text = "position_m,time_s,force_N,acceleration_m_s2\n".to_owned();
        for hit in 0..hits {
            let mut random = hit as u64 + 1;
            let fine = 50;
            let (mut u, mut v) = (0.0, 0.0);
            for sample in 0..SAMPLES {
                let time = sample as f64 * STEP_S;
                // Half a sine squared of 20 ms: nothing above 100 Hz.
                let force = |time: f64| {
                    if time < 0.02 {
                        (TAU / 0.04 * time).sin().powi(2) * (1.0 + hit as f64)
                    } else {
                        0.0
                    }
                };
                let acceleration = (force(time) - c * v - k * u) / m;
                random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                let disturbed = noise * ((random >> 40) as f64 / f64::from(1 << 24) - 0.5);
                let (f, a) = (force(time), acceleration + disturbed);
                writeln!(text, "2.5,{time},{f},{a}").unwrap();
                for part in 0..fine {
                    let step = STEP_S / f64::from(fine);
                    let now = time + f64::from(part) * step;
                    v += step * (force(now) - c * v - k * u) / m;
                    u += step * v;
                }
            }
        }
        text
    }

    #[test]
    fn an_oscillator_has_its_receptance_and_full_coherence() {
        let points = read(&signals(3, 0.0)).unwrap();
        let [point] = &points[..] else { panic!("{}", points.len()) };
        assert_eq!((point.position_m, point.hits), (2.5, Some(3)));
        let lines = point.frequencies_hz.iter().zip(&point.values).enumerate();
        for (index, (hz, value)) in lines.filter(|(_, (hz, _))| (5.0..50.0).contains(*hz)) {
            let omega = TAU * hz;
            let exact = Complex64::new(1e4 - omega * omega, 20.0 * omega).inv();
            assert!((value / exact - 1.0).norm() < 0.03, "{hz} Hz: {value} {exact}");
            assert!(point.coherence.as_ref().unwrap()[index] > 1.0 - 1e-9);
        }
        assert!(!point.is_turned());
    }

    #[test]
    fn noise_lowers_the_coherence_where_the_hammer_is_weak() {
        let points = read(&signals(6, 0.01)).unwrap();
        let coherence = points[0].coherence.as_ref().unwrap();
        let at = |hz: f64| {
            let index = points[0].frequencies_hz.partition_point(|other| *other < hz);
            coherence[index..index + 20].iter().sum::<f64>() / 20.0
        };
        assert!(at(16.0) > 0.99 && at(400.0) < 0.7, "{} {}", at(16.0), at(400.0));
    }

    #[test]
    fn one_hit_has_no_coherence() {
        let points = read(&signals(1, 0.0)).unwrap();
        assert_eq!((points[0].coherence.is_none(), points[0].hits), (true, Some(1)));
    }

    #[test]
    fn a_hit_whose_record_ends_early_does_not_cut_the_others() {
        let text = signals(3, 0.0);
        let cut: Vec<&str> = text.lines().take(1 + 2 * SAMPLES + 100).collect();
        let refused = read(&cut.join("\n")).unwrap_err().to_string();
        assert!(refused.starts_with("line 2050: the hit has 100 samples"), "{refused}");
    }

    #[test]
    fn signals_that_cannot_be_averaged_are_refused_by_line() {
        let head = "position_m,time_s,force_N,acceleration_m_s2\n";
        let rows = |skip: f64, force: f64| {
            (0..70).fold(head.to_owned(), |text, row| {
                let time = f64::from(row) * 1e-3 + if row > 50 { skip } else { 0.0 };
                format!("{text}1,{time},{},0.5\n", force * f64::from(row % 3))
            })
        };
        let refused = |text: &str| read(text).unwrap_err().to_string();
        let uneven = refused(&rows(0.5, 1.0));
        assert!(uneven.starts_with("line 53: the time step is 0.501"), "{uneven}");
        assert!(refused(&rows(0.0, 0.0)).contains("force of the hit is zero"));
        assert!(refused(&rows(0.0, 1.0)).contains("acceleration of all hits is zero"));
        assert!(refused(&format!("{head}1,0,1,1\n1,1e-3,1,1\n")).contains("2 samples"));
        assert!(refused(head).contains("no receptance"));
    }
}
