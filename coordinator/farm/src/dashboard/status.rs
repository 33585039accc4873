//! A farm at one moment: campaigns, workers, newest results, and the space covered so far.

use tracktwin_parameters::ParameterSet;

/// Everything that is shown of a farm, at one moment.
#[derive(Clone, Debug, Default)]
pub struct Farm {
    /// Name of the library.
    pub library: String,
    /// When, for people.
    pub at: String,
    /// The campaigns, in the order they are worked on.
    pub campaigns: Vec<FarmCampaign>,
    /// The workers, by time of their last message.
    pub workers: Vec<FarmWorker>,
    /// Whether the reader may press buttons.
    pub may_control: bool,
}

/// State of a campaign.
#[derive(Clone, Debug, Default)]
pub struct FarmCampaign {
    /// Its id.
    pub id: String,
    /// `running`, `paused` or `cancelled`.
    pub state: String,
    /// Cases of the highest priority are leased first.
    pub priority: i64,
    /// Waiting cases.
    pub waiting: u32,
    /// Cases that workers hold.
    pub leased: u32,
    /// Cases with results.
    pub finished: u32,
    /// Cases that were given up.
    pub failed: u32,
    /// Cases finished a second, lately.
    pub per_second: f64,
    /// Why cases were given up, and how many so.
    pub causes: Vec<(String, u32)>,
    /// Cases whose wheel lost contact with the rail.
    pub contact_lost: u32,
    /// The largest share of a pass's time without contact, 0 to 1.
    pub contact_loss_share_max: f64,
    /// Frequencies of the spectra in Hz.
    pub frequencies_hz: Vec<f64>,
    /// ln LWPS of the newest cases at the fastest speed, with what each is called.
    pub newest: Vec<(String, Vec<f64>)>,
    /// Finished cases, or an even share of them where there are many.
    pub covered: Vec<ParameterSet>,
    /// Cases that were given up.
    pub given_up: Vec<ParameterSet>,
}

/// A worker at its last message.
#[derive(Clone, Debug, Default)]
pub struct FarmWorker {
    /// Its name.
    pub id: String,
    /// Version of its program.
    pub code_version: String,
    /// Groups of cases it simulates at a time.
    pub cores: u32,
    /// Results it has brought.
    pub finished: u64,
    /// Failures it has reported.
    pub failed: u64,
    /// Mean computing time of a case in s.
    pub case_s: Option<f64>,
    /// Time since its last message in s.
    pub silent_s: f64,
    /// Why it gets no cases, if so.
    pub aside: Option<String>,
}

impl FarmWorker {
    /// Whether its last message is less than a minute old. Idle and suspended workers ask less
    /// often than leases are renewed.
    pub fn is_present(&self) -> bool {
        self.silent_s < 60.0
    }
}

impl FarmCampaign {
    /// All cases.
    pub const fn cases(&self) -> u32 {
        self.waiting + self.leased + self.finished + self.failed
    }

    /// Whether every case has its results or was given up.
    pub const fn is_done(&self) -> bool {
        self.waiting + self.leased == 0
    }

    /// Text of its state, or that it is done.
    pub fn state_text(&self) -> &str {
        if self.is_done() { "done" } else { &self.state }
    }

    /// Whether it is running and has cases left.
    pub fn is_at_work(&self) -> bool {
        self.state == "running" && !self.is_done()
    }

    /// How long the rest takes at the present rate, in s; none where no cases are leased.
    pub fn eta_s(&self) -> Option<f64> {
        let left = f64::from(self.waiting + self.leased);
        (self.is_at_work() && self.per_second > 0.0).then(|| left / self.per_second)
    }

    /// Text on the remaining time.
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

/// A time as people say it: the two largest units that matter.
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
