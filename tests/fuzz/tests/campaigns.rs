use super::ITERATIONS;
use tracktwin_farm::campaign::Campaign;

#[test]
fn a_campaign_file_is_understood_or_refused() {
    bolero::check!(name = "campaigns").with_iterations(ITERATIONS).for_each(|bytes: &[u8]| {
        let text = String::from_utf8_lossy(bytes);
        let Ok(campaign) = Campaign::parse(&text, "campaign.toml", None) else { return };
        let again = Campaign::parse(&text, "elsewhere.toml", None).unwrap();
        assert_eq!(campaign.id(), again.id());
    });
}
