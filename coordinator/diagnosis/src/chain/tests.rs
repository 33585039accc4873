//! Measuring chains with known faults.

use super::*;
use crate::along::testing::shared;

#[test]
fn scratch_chain() {
    for name in ["dev-01", "dev-02", "dev-03", "dev-04", "dev-05", "dev-06", "dev-07", "dev-08", "dev-09", "dev-10"] {
        let Some(recording) = shared(name) else { return };
        let start = std::time::Instant::now();
        println!("{name} {:?}", clipping(&recording, 1.0).iter().map(|c| (c.crests, c.ln_p)).collect::<Vec<_>>());
        println!("{name} {:?}", hum(&recording, 1.0));
        println!("{name} {:?}", gains(&recording).iter().map(|g| (g.gain_db, g.spread_db, g.ln_p)).collect::<Vec<_>>());
        let offsets = offsets(&recording);
        for o in &offsets { println!("{name} {} {} {:?} {} {}", o.matched.len(), o.stretches, o.line(), o.greatest_m(), o.correlation); }
        println!("{name} {:?} {:?} {:?}", troubles(&recording, &offsets), noise_floors(&recording), start.elapsed());
    }
}
