//! Formatting of instants.

use time::OffsetDateTime;

/// Formats an instant as ISO 8601 with milliseconds, as in `2026-11-21T08:20:49.125Z`. An instant outside
/// years of four digits becomes 1970.
pub(crate) fn iso_utc(unix_ms: i64) -> String {
    let at = OffsetDateTime::from_unix_timestamp_nanos(i128::from(unix_ms) * 1_000_000)
        .unwrap_or(OffsetDateTime::UNIX_EPOCH);
    let (year, month, day) = at.to_calendar_date();
    let (hour, minute, second, ms) = at.to_hms_milli();
    let month = u8::from(month);
    format!("{year:04}-{month:02}-{day:02}T{hour:02}:{minute:02}:{second:02}.{ms:03}Z")
}

#[cfg(test)]
mod tests {
    use super::iso_utc;

    /// The expected values are from `date -u -d @SECONDS +%FT%T`.
    #[test]
    fn instants_read_as_the_calendar_has_them() {
        assert_eq!(iso_utc(0), "1970-01-01T00:00:00.000Z");
        assert_eq!(iso_utc(951_826_154_007), "2000-02-29T12:09:14.007Z");
        assert_eq!(iso_utc(4_107_542_399_999), "2100-02-28T23:59:59.999Z");
        assert_eq!(iso_utc(i64::MAX), "1970-01-01T00:00:00.000Z");
    }
}
