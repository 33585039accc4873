//! Throughput of campaigns, from the cases finished in each ten seconds of the last minute.

use crate::engine::sql;
use crate::tally::{INTERVAL_S, interval};
use crate::{Library, LibraryError};
use std::collections::HashMap;

/// Averaging time of the rate in s; the current interval is added to it.
const OVER_S: i64 = 60;

/// Minimum averaging time in s. It prevents an excessive rate after the first report in a new interval.
const SHORTEST_S: f64 = 1.0;

/// An interval without results is a pause if at least this number of results was expected at the later
/// rate.
const MISSING_IN_A_PAUSE: f64 = 10.0;

/// Number of cases that a core simulates and reports together.
const GROUP: f64 = 8.0;

/// A pause must also be longer than a worker needs for this number of cases, because a worker reports
/// several cases together.
const CASES_IN_A_PAUSE: f64 = 2.0 * GROUP;

/// Throughput of a campaign.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Throughput {
    /// Cases finished per second.
    pub(crate) per_second: f64,
    /// Mean computing time of a case, in s.
    pub(crate) mean_case_s: Option<f64>,
}

/// Cases finished in an interval.
#[derive(Clone, Copy, Debug)]
struct Interval {
    from_unix_s: i64,
    finished: f64,
    busy_s: f64,
}

impl Library {
    /// Throughput of each campaign with results in the last minute.
    pub(crate) async fn throughputs(&self) -> Result<HashMap<String, Throughput>, LibraryError> {
        let now_unix_ms = self.now_unix_ms();
        let since_unix_s = interval(now_unix_ms) - OVER_S;
        let ask = "select campaign.id, from_unix_s, cast(sum(finished) as bigint) as finished,
                sum(busy_s) as busy_s,
                (select min(from_unix_s) from progress where campaign_id = campaign.id) as first_unix_s
            from campaign join progress on campaign_id = campaign.id and from_unix_s >= $1
            group by campaign.id, from_unix_s order by campaign.id, from_unix_s";
        let rows = self.readers().rows(sql(ask).bind(since_unix_s)).await?;
        let mut campaigns: HashMap<String, (i64, Vec<Interval>)> = HashMap::new();
        for row in &rows {
            let first_unix_s = row.get("first_unix_s")?;
            let (_, intervals) =
                campaigns.entry(row.get("id")?).or_insert((first_unix_s, Vec::new()));
            intervals.push(Interval {
                from_unix_s: row.get("from_unix_s")?,
                finished: f64::from(row.get_u32("finished")?),
                busy_s: row.get("busy_s")?,
            });
        }
        let now_unix_s = now_unix_ms as f64 / 1000.0;
        let throughput = |(first_unix_s, intervals): (i64, Vec<Interval>)| {
            throughput(&intervals, first_unix_s, since_unix_s, now_unix_s)
        };
        Ok(campaigns.into_iter().map(|(id, campaign)| (id, throughput(campaign))).collect())
    }
}

/// Throughput over these intervals since `since_unix_s`, in ascending order. It starts with the computation of
/// the campaign's first results, which the interval `first_unix_s` contains, or of the first ones after the last pause.
fn throughput(
    intervals: &[Interval],
    first_unix_s: i64,
    since_unix_s: i64,
    now_unix_s: f64,
) -> Throughput {
    let all: f64 = intervals.iter().map(|it| it.finished).sum();
    let busy_s: f64 = intervals.iter().map(|it| it.busy_s).sum();
    let mean_case_s = (all > 0.0).then(|| busy_s / all);
    let rate =
        |finished: f64, begun_unix_s: f64| finished / (now_unix_s - begun_unix_s).max(SHORTEST_S);
    // First results were computed before they were reported.
    let begun = |first_unix_s: i64| first_unix_s as f64 - GROUP * mean_case_s.unwrap_or(0.0);
    let start_unix_s = since_unix_s.max(first_unix_s);
    let mut finished = 0.0;
    for (place, latest) in intervals.iter().enumerate().rev() {
        finished += latest.finished;
        let earlier = place.checked_sub(1).map(|place| intervals[place].from_unix_s + INTERVAL_S);
        let still_s = (latest.from_unix_s - earlier.unwrap_or(start_unix_s)) as f64;
        let per_second = rate(finished, begun(latest.from_unix_s));
        if still_s * per_second > MISSING_IN_A_PAUSE
            && still_s > CASES_IN_A_PAUSE * mean_case_s.unwrap_or(0.0)
        {
            return Throughput { per_second, mean_case_s };
        }
    }
    let begun_unix_s =
        if first_unix_s < since_unix_s { since_unix_s as f64 } else { begun(first_unix_s) };
    Throughput { per_second: rate(all, begun_unix_s), mean_case_s }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Intervals from pairs of start (in s since 1970) and number of finished cases, with `case_s` seconds
    /// per case.
    fn intervals(finished: &[(i64, f64)], case_s: f64) -> Vec<Interval> {
        let interval = |&(from_unix_s, finished): &(i64, f64)| Interval {
            from_unix_s,
            finished,
            busy_s: case_s * finished,
        };
        finished.iter().map(interval).collect()
    }

    #[test]
    fn after_a_pause_the_rate_is_that_since_then() {
        // A group of cases takes 2 s.
        let paused = intervals(&[(0, 250.0), (50, 270.0), (60, 80.0)], 0.25);
        assert_eq!(throughput(&paused, -100, 0, 62.0).per_second, 25.0);
        // A campaign that stood still for longer than is looked at.
        let resumed = intervals(&[(50, 270.0), (60, 80.0)], 0.25);
        assert_eq!(throughput(&resumed, -100, 0, 62.0).per_second, 25.0);
    }

    #[test]
    fn results_that_come_seldom_or_many_at_a_time_are_no_pauses() {
        let seldom = intervals(&[(0, 1.0), (30, 1.0), (60, 1.0)], 20.0);
        assert_eq!(throughput(&seldom, -100, 0, 66.0).per_second, 3.0 / 66.0);
        let many_at_a_time = intervals(&[(0, 128.0), (30, 128.0), (60, 128.0)], 2.0);
        assert_eq!(throughput(&many_at_a_time, -100, 0, 64.0).per_second, 6.0);
    }

    #[test]
    fn the_first_results_took_their_computing_time() {
        // Two cores begin at 0; each needs 40 s for its first group of cases.
        let first = intervals(&[(40, 16.0)], 5.0);
        assert_eq!(throughput(&first, 40, -20, 40.5).per_second, 16.0 / 40.5);
        // Later results come from a window of known length.
        assert_eq!(throughput(&first, -100, 0, 64.0).per_second, 16.0 / 64.0);
    }

    #[test]
    fn the_mean_of_a_case_is_that_of_the_last_minute() {
        assert_eq!(
            throughput(&intervals(&[(0, 3.0), (50, 1.0)], 0.5), 0, 0, 60.0).mean_case_s,
            Some(0.5)
        );
        assert_eq!(throughput(&intervals(&[(0, 0.0)], 0.5), 0, 0, 60.0), Throughput::default());
    }
}
