//! Computing the features of a window.

use super::{Error, Line};
use tracktwin_benches::{axle_box, cost};
use tracktwin_signal::{Extractor, FeatureDefinition};

pub(crate) fn transforms() -> Result<Vec<Line>, Error> {
    let (window, margin) = (3485, 6000);
    let signal = axle_box(window + 2 * margin);
    let range = margin..margin + window;
    let every = FeatureDefinition { instant_rate_hz: 1e5, thinned: false, ..Default::default() };
    let literal = Extractor::new(&every)?.extract_literally(&signal, range.clone())?;
    let kinds = [
        ("transform, every instant", every.clone()),
        ("transform, low bins thinned", FeatureDefinition { thinned: true, ..every.clone() }),
        ("transform, every 4th instant", FeatureDefinition { instant_rate_hz: 25e3, ..every }),
        ("transform as features take it", FeatureDefinition::default()),
    ];
    kinds
        .into_iter()
        .map(|(name, definition)| {
            let extractor = Extractor::new(&definition)?;
            let features = extractor.extract(&signal, range.clone())?;
            let mut errors: Vec<f64> = (features.log_power.iter().zip(&literal.log_power))
                .map(|(a, b)| (a - b).abs())
                .collect();
            errors.sort_by(f64::total_cmp);
            let quantile = |share: usize| errors[errors.len() * share / 100];
            let [median, most] = [50, 95].map(quantile);
            let accuracy = format!("ln LWPS {median:.1e} in the median, 95 % below {most:.1e}");
            Ok(Line::new(name, cost(|| extractor.extract(&signal, range.clone())), accuracy))
        })
        .collect()
}
