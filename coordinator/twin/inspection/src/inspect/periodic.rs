//! Shapes of wheel and rail, and hum, which may look like each other.

use super::{EACH_TEST, comb_of_wheel, separate_orders, surface};
use crate::chain::{self, Hum};
use crate::finding::Finding;
use crate::wheel::{Comb, Flat, Order};
use tracktwin_signal::recording::Recording;

/// What repeats along the track, with the wheel, or in time.
pub(super) struct Periodic {
    pub(super) flat: Option<Flat>,
    pub(super) orders: Vec<Order>,
    /// Findings on wheel and rail surface.
    pub(super) on_surface: Vec<Finding>,
    pub(super) comb: Option<Comb>,
    pub(super) hum: Vec<Hum>,
    pub(super) hum_or_orders: Vec<Hum>,
}

/// Shapes of wheel and rail, and hum. At one of the speeds hum may have the frequency of an order, so that shapes are
/// searched for again without it.
pub(super) fn periodic(recording: &Recording) -> Periodic {
    let mut shapes = surface(recording);
    let (flat, orders, _) = &shapes;
    let comb = comb_of_wheel(recording, flat.is_none() && orders.is_empty());
    let turn_m = flat.as_ref().map(|flat| flat.circumference_m.0);
    let hum = chain::hum(recording, turn_m, EACH_TEST);
    let (hum_or_orders, hum) = separate_orders(recording, comb.as_ref(), flat.as_ref(), hum);
    if !hum.is_empty() {
        shapes = surface(&chain::without_hum(recording, &hum));
    }
    let (flat, orders, on_surface) = shapes;
    Periodic { flat, orders, on_surface, comb, hum, hum_or_orders }
}
