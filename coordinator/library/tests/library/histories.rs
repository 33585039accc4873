//! Every history of leases, reports, expiries, repetitions and restarts ends with each case finished or
//! given up exactly once.

use crate::support::{ATTEMPTS_MAX, CAMPAIGN, Home, failed, finished, held, lease, report};
use proptest::prelude::*;
use tokio::runtime::Runtime;
use tracktwin_library::{Leased, Library, ReportVerdict, Retry, State};

const CASES: u32 = 6;

/// An event in the history of a farm.
#[derive(Clone, Debug)]
enum Event {
    Lease {
        worker: usize,
        max: u32,
    },
    /// A report for one of the leases given so far. The lease may have expired, or may have been reported
    /// before.
    Finish {
        lease: usize,
    },
    Fail {
        lease: usize,
    },
    Renew {
        lease: usize,
    },
    Release {
        lease: usize,
    },
    /// Time passes; the time may be shorter or longer than a lease.
    Pass {
        ms: i64,
    },
    /// The coordinator is restarted; its workers continue, or have ended with it.
    Restart {
        alone: bool,
    },
    /// Workers change to the other coordinator.
    TurnToOther,
    Pause,
    Resume,
    Cancel,
    Retry,
}

fn event() -> impl Strategy<Value = Event> {
    prop_oneof![
        3 => (0..3_usize, 1..4_u32).prop_map(|(worker, max)| Event::Lease { worker, max }),
        3 => any::<usize>().prop_map(|lease| Event::Finish { lease }),
        2 => any::<usize>().prop_map(|lease| Event::Fail { lease }),
        1 => any::<usize>().prop_map(|lease| Event::Renew { lease }),
        1 => any::<usize>().prop_map(|lease| Event::Release { lease }),
        2 => (1..1500_i64).prop_map(|ms| Event::Pass { ms }),
        1 => any::<bool>().prop_map(|alone| Event::Restart { alone }),
        2 => Just(Event::TurnToOther),
        1 => prop_oneof![Just(Event::Pause), Just(Event::Cancel), Just(Event::Retry)],
        1 => Just(Event::Resume),
    ]
}

/// A farm of two coordinators, and the expected content of its library.
struct Farm<'a> {
    home: &'a Home,
    libraries: [Option<Library>; 2],
    present: usize,
    now: i64,
    leases: Vec<(String, Leased)>,
    stored: [u32; CASES as usize],
}

impl<'a> Farm<'a> {
    async fn new(home: &'a Home) -> Self {
        let libraries = [Some(home.library(CASES).await), Some(home.open().await)];
        let stored = [0; CASES as usize];
        Self { home, libraries, present: 0, now: 0, leases: Vec::new(), stored }
    }

    fn library(&self) -> &Library {
        self.libraries[self.present].as_ref().unwrap()
    }

    fn earlier(&self, choice: usize) -> Option<(String, Leased)> {
        (!self.leases.is_empty()).then(|| self.leases[choice % self.leases.len()].clone())
    }

    async fn lease(&mut self, worker: String, max: u32) {
        for leased in lease(self.library(), &worker, max, self.now).await {
            let same = |(_, it): &(String, Leased)| held(it) == held(&leased);
            assert!(!self.leases.iter().any(same), "a case was leased twice at one epoch");
            assert_eq!(self.stored[leased.case.index as usize], 0, "a finished case was leased");
            self.leases.push((worker.clone(), leased));
        }
    }

    async fn finish(&mut self, worker: &str, leased: &Leased) {
        let verdict = report(self.library(), worker, vec![finished(leased)]).await[0];
        assert_ne!(verdict, ReportVerdict::Refused, "{worker} held {leased:?}");
        if verdict == ReportVerdict::Stored {
            self.stored[leased.case.index as usize] += 1;
        }
    }

    async fn happen(&mut self, event: Event) {
        match event {
            Event::Lease { worker, max } => self.lease(format!("w{worker}"), max).await,
            Event::Pass { ms } => self.now += ms,
            Event::Restart { alone } => self.restart(alone).await,
            Event::TurnToOther => self.present = 1 - self.present,
            Event::Pause => self.library().pause(CAMPAIGN).await.unwrap(),
            Event::Resume => self.library().resume(CAMPAIGN).await.unwrap(),
            Event::Cancel => self.library().cancel(CAMPAIGN).await.unwrap(),
            Event::Retry => {
                self.library().retry(CAMPAIGN, Retry::Failed).await.unwrap();
            }
            Event::Finish { lease } => {
                if let Some((worker, leased)) = self.earlier(lease) {
                    self.finish(&worker, &leased).await;
                }
            }
            Event::Fail { lease } => {
                if let Some((worker, leased)) = self.earlier(lease) {
                    report(self.library(), &worker, vec![failed(&leased)]).await;
                }
            }
            Event::Renew { lease } => {
                if let Some((worker, leased)) = self.earlier(lease) {
                    let until = self.now + 1000;
                    let library = self.library();
                    library.renew(CAMPAIGN, &worker, vec![held(&leased)], until).await.unwrap();
                }
            }
            Event::Release { lease } => {
                if let Some((worker, leased)) = self.earlier(lease) {
                    let library = self.library();
                    library.release(CAMPAIGN, &worker, vec![held(&leased)]).await.unwrap();
                }
            }
        }
    }

    async fn restart(&mut self, alone: bool) {
        self.libraries[self.present].take().unwrap().close().await;
        let library = self.home.open().await;
        if alone {
            library.release_all(CAMPAIGN).await.unwrap();
        }
        self.libraries[self.present] = Some(library);
    }

    /// A sound worker finishes the remaining cases.
    async fn end(&mut self) {
        self.library().resume(CAMPAIGN).await.unwrap();
        for _ in 0..=ATTEMPTS_MAX * CASES {
            let before = self.leases.len();
            self.now += 1000;
            self.lease("last".to_owned(), CASES).await;
            for (worker, leased) in self.leases.split_off(before) {
                self.finish(&worker, &leased).await;
            }
        }
    }

    async fn check(&self) {
        let status = self.library().status(CAMPAIGN).await.unwrap();
        assert_eq!((status.total(), status.done()), (CASES, CASES), "{status:?}");
        let mut entries = Vec::new();
        self.library()
            .training_set(CAMPAIGN, |entry| entries.push(entry.case.index))
            .await
            .unwrap();
        for index in 0..CASES {
            let record = self.library().case(CAMPAIGN, index).await.unwrap().unwrap();
            let stored = u32::from(record.state == State::Finished);
            assert_eq!(self.stored[index as usize], stored, "case {index}: {record:?}");
            assert_eq!(entries.iter().filter(|it| **it == index).count() as u32, stored);
            // Failures are counted by themselves, so that losses between them may add to what it takes.
            let given_up_at = ATTEMPTS_MAX..2 * ATTEMPTS_MAX;
            assert!(
                stored == 1 || given_up_at.contains(&record.attempts),
                "case {index}: {record:?}"
            );
        }
    }
}

/// Number of histories. Each uses a real database with committed transactions.
const HISTORIES: u32 = 48;

fn play(runtime: &Runtime, home: &Home, events: Vec<Event>) {
    runtime.block_on(async {
        let mut farm = Farm::new(home).await;
        for event in events {
            farm.happen(event).await;
        }
        farm.end().await;
        farm.check().await;
        for library in farm.libraries.into_iter().flatten() {
            library.close().await;
        }
    });
}

proptest! {
    #![proptest_config(ProptestConfig { cases: HISTORIES, ..ProptestConfig::default() })]

    #[test]
    fn every_history_ends_with_each_case_finished_or_given_up_once_in_a_file(
        events in proptest::collection::vec(event(), 1..40)
    ) {
        play(&Runtime::new().unwrap(), &Home::sqlite_in_memory(), events);
    }

    #[test]
    fn every_history_ends_with_each_case_finished_or_given_up_once_on_a_server(
        events in proptest::collection::vec(event(), 1..40)
    ) {
        if let Some(home) = Home::postgres() {
            play(&Runtime::new().unwrap(), &home, events);
        }
    }
}
