//! Sentence on loss of contact between wheel and rail in the cases of a campaign.

use tracktwin_drawing::percent;
use tracktwin_library::ContactLoss;

/// The sentence for this number of finished cases.
pub(crate) fn contact_sentence(lost: ContactLoss, finished: u32) -> String {
    match lost.cases {
        0 => {
            format!("no loss of contact between wheel and rail is recorded in {finished} cases")
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
        assert!(contact_sentence(ContactLoss::default(), 400).ends_with("in 400 cases"));
    }
}
