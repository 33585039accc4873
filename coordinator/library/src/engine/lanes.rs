//! Which of several transactions at a time a write goes into.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard};

/// Writes on their way, by lane.
///
/// Those of one worker are in one lane, for they change the same rows; whoever has none under way
/// takes the emptiest.
#[derive(Clone)]
pub(super) struct Lanes(Arc<Mutex<UnderWay>>);

struct UnderWay {
    /// Writes in each lane.
    counts: Vec<usize>,
    /// The lane of each worker with writes under way, and how many they are.
    workers: HashMap<String, (usize, usize)>,
}

/// A write's place in a lane, until it is dropped.
pub(super) struct Place {
    lanes: Lanes,
    number: usize,
    worker: String,
}

impl Lanes {
    /// So many empty ones, at least one.
    pub(super) fn new(count: usize) -> Self {
        let under_way = UnderWay { counts: vec![0; count], workers: HashMap::new() };
        Self(Arc::new(Mutex::new(under_way)))
    }

    /// A place for a write of a worker.
    pub(super) fn enter(&self, worker: &str) -> Place {
        let mut under_way = self.lock();
        let UnderWay { counts, workers } = &mut *under_way;
        let emptiest = (0..counts.len()).min_by_key(|&lane| counts[lane]).unwrap_or(0);
        let (number, of_worker) = workers.entry(worker.to_owned()).or_insert((emptiest, 0));
        *of_worker += 1;
        counts[*number] += 1;
        Place { lanes: self.clone(), number: *number, worker: worker.to_owned() }
    }

    fn lock(&self) -> MutexGuard<'_, UnderWay> {
        self.0.lock().expect("nobody panics while holding it")
    }
}

impl Place {
    /// The lane, from 0.
    pub(super) const fn number(&self) -> usize {
        self.number
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        let mut under_way = self.lanes.lock();
        under_way.counts[self.number] -= 1;
        if let Some((_, of_worker)) = under_way.workers.get_mut(&self.worker) {
            *of_worker -= 1;
            if *of_worker == 0 {
                under_way.workers.remove(&self.worker);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Lanes;

    #[test]
    fn workers_take_the_emptiest_lane_and_stay_in_it_while_they_write() {
        let lanes = Lanes::new(2);
        let places = ["a", "b", "a", "a", "c"].map(|worker| lanes.enter(worker));
        assert_eq!(places.each_ref().map(super::Place::number), [0, 1, 0, 0, 1]);
        drop(places);
        let [b, a] = ["b", "a"].map(|worker| lanes.enter(worker));
        assert_eq!([b.number(), a.number()], [0, 1], "nobody keeps a lane");
    }

    #[test]
    fn of_one_lane_everybody_takes_it_and_nobody_is_remembered() {
        let lanes = Lanes::new(1);
        for worker in ["a", "b"] {
            assert_eq!(lanes.enter(worker).number(), 0);
        }
        assert!(lanes.lock().workers.is_empty() && lanes.lock().counts == [0]);
    }
}
