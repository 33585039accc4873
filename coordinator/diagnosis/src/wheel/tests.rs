//! Wheels of recordings whose truth is known.

use super::{flat, nominal_circumference_m, out_of_round};
use crate::along::testing::shared;

#[test]
fn scratch_wheel() {
    for name in ["dev-01", "dev-02", "dev-03", "dev-04", "dev-05", "dev-06", "dev-07", "dev-08", "dev-09", "dev-10"] {
        let Some(recording) = shared(name) else { return };
        let start = std::time::Instant::now();
        let circumference = nominal_circumference_m(&recording).unwrap();
        println!("{name} {:?} {:?}", flat(&recording, circumference, 1.0), start.elapsed());
        println!("{name} {:?} {:?}", out_of_round(&recording, circumference, 0.999), start.elapsed());
    }
}
