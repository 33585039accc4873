//! Measurement of CPU time and of wall-clock time.

use std::time::Instant;

/// Number of runs of one piece of work.
const REPEATS: usize = 5;

/// Minimum duration of a run in s. The system counts CPU time in steps of some milliseconds.
const RUN_S: f64 = 0.3;

/// CPU time of one piece of work over repeated runs, in s.
#[derive(Clone, Copy, Debug)]
pub struct Cost {
    /// Time of the fastest run in s.
    pub least_s: f64,
    /// Median time in s.
    pub median_s: f64,
}

impl Cost {
    /// The cost of each of `count` equal parts of the work.
    #[must_use]
    pub fn of_each(self, count: usize) -> Self {
        let count = count as f64;
        Self { least_s: self.least_s / count, median_s: self.median_s / count }
    }
}

/// Measures the CPU time of `work` in several runs, after one run that fills caches. Short work is repeated
/// within a run.
pub fn cost<T>(mut work: impl FnMut() -> T) -> Cost {
    let started = Instant::now();
    std::hint::black_box(work());
    let times = (RUN_S / started.elapsed().as_secs_f64().max(1e-6)).ceil() as usize;
    let mut seconds: Vec<f64> = (0..REPEATS)
        .map(|_| {
            let before = cpu_s();
            for _ in 0..times {
                std::hint::black_box(work());
            }
            (cpu_s() - before) / times as f64
        })
        .collect();
    seconds.sort_by(f64::total_cmp);
    Cost { least_s: seconds[0], median_s: seconds[REPEATS / 2] }
}

/// Measures the wall-clock time of work on several cores in repeated runs, after one run that fills caches.
pub fn by_the_clock<T>(mut work: impl FnMut() -> T) -> Cost {
    let mut seconds: Vec<f64> = (0..=REPEATS)
        .map(|_| {
            let started = Instant::now();
            std::hint::black_box(work());
            started.elapsed().as_secs_f64()
        })
        .skip(1)
        .collect();
    seconds.sort_by(f64::total_cmp);
    Cost { least_s: seconds[0], median_s: seconds[REPEATS / 2] }
}

/// Runs long work once. Returns its result and its cost.
pub fn once<T>(work: impl FnOnce() -> T) -> (T, Cost) {
    let before = cpu_s();
    let out = work();
    let seconds = cpu_s() - before;
    (out, Cost { least_s: seconds, median_s: seconds })
}

/// CPU time used by all threads of this process, in s.
fn cpu_s() -> f64 {
    cpu_of_threads("")
}

/// CPU time used by the threads of this process whose names begin with `name`, in s. The system keeps 15
/// bytes of a name.
pub fn cpu_of_threads(name: &str) -> f64 {
    let tasks = std::fs::read_dir("/proc/self/task").into_iter().flatten().flatten();
    let nanoseconds = tasks.filter_map(|task| {
        let read = |file| std::fs::read_to_string(task.path().join(file)).ok();
        let its_name = read("comm")?;
        let scheduled = read("schedstat").filter(|_| its_name.starts_with(name))?;
        scheduled.split(' ').next()?.parse::<f64>().ok()
    });
    nanoseconds.sum::<f64>() * 1e-9
}
