//! State of a farm at one moment: campaigns, workers, newest results, and covered parameter space.

use tracktwin_parameters::ParameterSet;

/// State of a farm at one moment, as shown on its page.
#[derive(Clone, Debug, Default)]
pub struct Farm {
    /// Name of the library.
    pub library: String,
    /// Time of this state, in UTC, as text.
    pub at: String,
    /// The campaigns, in the order of leasing.
    pub campaigns: Vec<FarmCampaign>,
    /// The workers, the one with the newest message first.
    pub workers: Vec<FarmWorker>,
    /// Whether the reader may use the controls.
    pub may_control: bool,
}

/// State of a campaign.
#[derive(Clone, Debug, Default)]
pub struct FarmCampaign {
    /// Id of the campaign.
    pub id: String,
    /// `running`, `paused` or `cancelled`.
    pub state: String,
    /// Priority: cases of the campaign with the highest priority are leased first.
    pub priority: i64,
    /// Number of waiting cases.
    pub waiting: u32,
    /// Number of leased cases.
    pub leased: u32,
    /// Number of cases with results.
    pub finished: u32,
    /// Number of cases that were given up.
    pub failed: u32,
    /// Cases finished per second, averaged over about the last minute.
    pub per_second: f64,
    /// Reasons for giving up cases, each with the number of cases.
    pub causes: Vec<(String, u32)>,
    /// Number of cases with loss of contact between wheel and rail.
    pub contact_lost: u32,
    /// Largest contact-loss share of a pass, 0 to 1.
    pub contact_loss_share_max: f64,
    /// Frequencies of the spectra in `newest`, in Hz.
    pub frequencies_hz: Vec<f64>,
    /// Newest cases: label, and ln LWPS at the highest speed, by frequency.
    pub newest: Vec<(String, Vec<f64>)>,
    /// Parameters of finished cases; of many cases, an even selection.
    pub covered: Vec<ParameterSet>,
    /// Parameters of cases that were given up.
    pub given_up: Vec<ParameterSet>,
}

/// A worker at its last message.
#[derive(Clone, Debug, Default)]
pub struct FarmWorker {
    /// Name of the worker.
    pub id: String,
    /// Version of the worker's program.
    pub code_version: String,
    /// Number of groups of cases that the worker simulates in parallel.
    pub cores: u32,
    /// Number of results reported first by this worker.
    pub finished: u64,
    /// Number of failures reported by this worker.
    pub failed: u64,
    /// Mean computing time of a case in s.
    pub case_s: Option<f64>,
    /// Time since the last message, in s.
    pub silent_s: f64,
    /// Whether the worker is in quarantine.
    pub quarantined: bool,
    /// Reason of the quarantine, or the number of failures in a row, as text; `None` if neither applies.
    pub aside: Option<String>,
}

impl FarmWorker {
    /// Whether the last message is less than a minute old. Idle and suspended workers send requests less
    /// often than leases are renewed.
    pub fn is_present(&self) -> bool {
        self.silent_s < 60.0
    }
}

impl FarmCampaign {
    /// Number of cases.
    pub const fn cases(&self) -> u32 {
        self.waiting + self.leased + self.finished + self.failed
    }

    /// Whether every case is finished or given up.
    pub const fn is_done(&self) -> bool {
        self.waiting + self.leased == 0
    }

    /// The state as text; `done` if every case is done.
    pub fn state_text(&self) -> &str {
        if self.is_done() { "done" } else { &self.state }
    }

    /// Whether the campaign is running and has open cases.
    pub fn is_at_work(&self) -> bool {
        self.state == "running" && !self.is_done()
    }

    /// Estimated remaining time at the present rate, in s; `None` if no cases are leased or the rate is
    /// zero.
    pub fn eta_s(&self) -> Option<f64> {
        let left = f64::from(self.waiting + self.leased);
        (self.is_at_work() && self.per_second > 0.0).then(|| left / self.per_second)
    }

    /// The remaining time as text.
    pub fn left(&self) -> String {
        match self.eta_s() {
            Some(eta_s) => format!("{} left", duration(eta_s)),
            None if self.is_done() && self.failed > 0 => {
                "done, except for given-up cases".to_owned()
            }
            None if self.is_done() => "nothing left to do".to_owned(),
            None if !self.is_at_work() => "no cases are leased".to_owned(),
            None => "rate unknown".to_owned(),
        }
    }
}

/// Formats a time in s with its two largest units.
pub fn duration(seconds: f64) -> String {
    let whole = seconds.max(0.0).round() as u64;
    let (days, hours, minutes) = (whole / 86_400, whole / 3600 % 24, whole / 60 % 60);
    match (days, hours, minutes) {
        (0, 0, 0) => format!("{whole} s"),
        (0, 0, _) => format!("{minutes} min {} s", whole % 60),
        (0, ..) => format!("{hours} h {minutes} min"),
        _ => format!("{days} d {hours} h"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_paused_campaign_has_no_time_left() {
        let running = FarmCampaign {
            state: "running".to_owned(),
            waiting: 60,
            leased: 10,
            per_second: 2.0,
            ..FarmCampaign::default()
        };
        assert_eq!(running.left(), "35 s left");
        let paused = FarmCampaign { state: "paused".to_owned(), ..running };
        assert_eq!((paused.eta_s(), paused.left().as_str()), (None, "no cases are leased"));
        let done = FarmCampaign { waiting: 0, leased: 0, failed: 1, ..paused };
        assert_eq!(
            (done.state_text(), done.left().as_str()),
            ("done", "done, except for given-up cases")
        );
    }

    #[test]
    fn durations_have_two_units() {
        let said = [12.0, 75.0, 3_700.0, 200_000.0].map(duration);
        assert_eq!(said, ["12 s", "1 min 15 s", "1 h 1 min", "2 d 7 h"]);
    }
}
