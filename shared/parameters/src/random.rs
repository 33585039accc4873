//! Conversion of random bits to numbers, independent of the version of any library.

/// The upper 53 of 64 random bits as a number in [0, 1).
pub const fn unit(bits: u64) -> f64 {
    (bits >> 11) as f64 / (1_u64 << 53) as f64
}

#[cfg(test)]
mod tests {
    use super::unit;

    #[test]
    fn bits_fill_the_unit_interval_and_leave_its_end_out() {
        assert_eq!([unit(0), unit(1 << 63)], [0.0, 0.5]);
        assert!(unit(u64::MAX) < 1.0);
    }
}
