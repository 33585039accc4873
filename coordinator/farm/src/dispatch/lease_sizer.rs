//! Number of cases in a lease: enough for one or two seconds of computing.

use tracktwin_worker::agent::GROUP;

/// Minimum computing time of a lease, in s.
///
/// It is long compared with the milliseconds that a lease and a report cost. It is short enough that the
/// loss of one lease with its worker does not matter.
const LEASE_WORK_S: f64 = 1.5;

/// Target for the number of leases per second of all cores together. With more cores, leases become longer.
///
/// A lease costs the library about 1 ms; this rate uses a tenth of the library's time.
const LEASES_A_SECOND: f64 = 100.0;

/// Maximum computing time of a lease, in s. It bounds the wait for the last cores at the end of a campaign.
const LEASE_WORK_MAX_S: f64 = 30.0;

/// Maximum number of groups in a lease. It bounds the number of cases lost with a worker.
const GROUPS_MAX: f64 = 64.0;

/// Weight of the newest measurement in the running mean.
const NEWEST: f64 = 0.1;

/// Running mean of the computing time of a case; it determines the size of leases.
#[derive(Clone, Copy, Debug, Default)]
pub struct LeaseSizer {
    case_s: Option<f64>,
}

impl LeaseSizer {
    /// Adds a measured computing time of one case, in s, to the running mean.
    pub fn measured(&mut self, case_s: f64) {
        let mean = self.case_s.unwrap_or(case_s);
        self.case_s = Some(mean + NEWEST * (case_s - mean));
    }

    /// Number of cases in a lease if this number of cores works: a whole number of groups, at least one.
    pub fn cases_per_lease(&self, cores: u32) -> u32 {
        let work_s = (f64::from(cores) / LEASES_A_SECOND).clamp(LEASE_WORK_S, LEASE_WORK_MAX_S);
        let groups = self.case_s.map_or(1.0, |case_s| work_s / (case_s * GROUP as f64));
        // A case that takes no time at all makes the quotient infinite, and clamped.
        groups.round().clamp(1.0, GROUPS_MAX) as u32 * GROUP as u32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lease_at(case_s: f64) -> u32 {
        let mut lease_sizer = LeaseSizer::default();
        lease_sizer.measured(case_s);
        lease_sizer.cases_per_lease(2)
    }

    #[test]
    fn a_lease_is_one_or_two_seconds_of_work_in_whole_groups() {
        assert_eq!(LeaseSizer::default().cases_per_lease(2), 8);
        assert_eq!(lease_at(10.0), 8);
        assert_eq!(lease_at(0.02), 72);
        assert_eq!(lease_at(0.0), 512);
    }

    #[test]
    fn the_more_cores_there_are_the_longer_leases_become_up_to_a_bound() {
        let mut lease_sizer = LeaseSizer::default();
        lease_sizer.measured(0.125);
        let leases = [16, 160, 1600, 16_000].map(|cores| lease_sizer.cases_per_lease(cores));
        // 1.5 s, 1.6 s, 16 s and 30 s of work in groups of a second.
        assert_eq!(leases, [16, 16, 128, 240]);
    }

    #[test]
    fn the_pace_follows_a_slower_machine() {
        let mut lease_sizer = LeaseSizer::default();
        lease_sizer.measured(0.02);
        (0..100).for_each(|_| lease_sizer.measured(0.1));
        assert_eq!(lease_sizer.cases_per_lease(2), 16);
    }
}
