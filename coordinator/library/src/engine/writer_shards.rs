//! Distribution of writes over parallel transactions.

use parking_lot::{Mutex, MutexGuard};
use std::collections::HashMap;
use std::sync::Arc;

/// Pending writes by shard.
///
/// All pending writes of one worker are in one shard, because they change the same rows. A worker without
/// pending writes gets the shard with the fewest pending writes.
#[derive(Clone)]
pub(super) struct WriterShards(Arc<Mutex<UnderWay>>);

struct UnderWay {
    /// Pending writes of each shard.
    counts: Vec<usize>,
    /// Shard and number of pending writes of each worker that has some.
    workers: HashMap<String, (usize, usize)>,
}

/// The place of a pending write in a shard; it is freed when the slot is dropped.
pub(super) struct Slot {
    shards: WriterShards,
    number: usize,
    worker: String,
}

impl WriterShards {
    /// `count` empty shards, at least one.
    pub(super) fn new(count: usize) -> Self {
        let under_way = UnderWay { counts: vec![0; count], workers: HashMap::new() };
        Self(Arc::new(Mutex::new(under_way)))
    }

    /// Takes a slot for a write of this worker.
    pub(super) fn enter(&self, worker: &str) -> Slot {
        let mut under_way = self.lock();
        let UnderWay { counts, workers } = &mut *under_way;
        let emptiest = (0..counts.len()).min_by_key(|&shard| counts[shard]).unwrap_or(0);
        let (number, of_worker) = workers.entry(worker.to_owned()).or_insert((emptiest, 0));
        *of_worker += 1;
        counts[*number] += 1;
        Slot { shards: self.clone(), number: *number, worker: worker.to_owned() }
    }

    fn lock(&self) -> MutexGuard<'_, UnderWay> {
        self.0.lock()
    }
}

impl Slot {
    /// Number of the shard, from 0.
    pub(super) const fn number(&self) -> usize {
        self.number
    }
}

impl Drop for Slot {
    fn drop(&mut self) {
        let mut under_way = self.shards.lock();
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
    use super::WriterShards;

    #[test]
    fn workers_take_the_emptiest_lane_and_stay_in_it_while_they_write() {
        let shards = WriterShards::new(2);
        let slots = ["a", "b", "a", "a", "c"].map(|worker| shards.enter(worker));
        assert_eq!(slots.each_ref().map(super::Slot::number), [0, 1, 0, 0, 1]);
        drop(slots);
        let [b, a] = ["b", "a"].map(|worker| shards.enter(worker));
        assert_eq!([b.number(), a.number()], [0, 1], "nobody keeps a lane");
    }

    #[test]
    fn of_one_lane_everybody_takes_it_and_nobody_is_remembered() {
        let shards = WriterShards::new(1);
        for worker in ["a", "b"] {
            assert_eq!(shards.enter(worker).number(), 0);
        }
        assert!(shards.lock().workers.is_empty() && shards.lock().counts == [0]);
    }
}
