//! How many cases of a campaign lost contact between wheel and rail, in words.

use tracktwin_drawing::percent;
use tracktwin_library::ContactLoss;

/// What a reader has to know of so many finished cases.
pub(crate) fn contact_sentence(lost: ContactLoss, finished: u32) -> String {
    match lost.cases {
        0 => {
            format!("none of {finished} cases is known to have lost contact between wheel and rail")
        }
        cases => format!(
            "{cases} of {finished} cases lost contact between wheel and rail (at most {} of the time)",
            percent(lost.largest_share)
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sentence_tells_how_many_and_for_how_long() {
        let said = contact_sentence(ContactLoss { cases: 12, largest_share: 0.031 }, 400);
        assert_eq!(
            said,
            "12 of 400 cases lost contact between wheel and rail (at most 3.1 % of the time)"
        );
        assert!(contact_sentence(ContactLoss::default(), 400).starts_with("none of 400 cases"));
    }
}
