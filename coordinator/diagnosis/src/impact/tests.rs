//! Impacts and corrugation of recordings whose truth is known.

use super::{Form, corrugation, impacts};
use crate::along::testing::shared;

#[test]
fn scratch() {
    for name in ["dev-01", "dev-02", "dev-03", "dev-04", "dev-05", "dev-06", "dev-07", "dev-08", "dev-09", "dev-10"] {
        let Some(recording) = shared(name) else { return };
        let start = std::time::Instant::now();
        for impact in impacts(&recording, 0.99, &[]) {
            println!("{name} {impact:?}");
        }
        println!("{name} {:?}", start.elapsed());
        println!("{name} {:?} {:?}", corrugation(&recording, 1.0, None), start.elapsed());
    }
    let _ = Form::Dip;
}
