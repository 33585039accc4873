//! A study with made-up estimates, for tests.

use crate::{Estimated, Plan, Ring, SleeperTruth, Stretch, Study};
use serde_json::{Map, Value, json};
use tracktwin_parameters::Parameter;

/// The whole ring, two laps, three speeds, without estimates.
pub(crate) fn study() -> Study {
    let plan = Plan::new(1, 2, vec![7.0, 10.0, 13.0], Stretch::WHOLE).expect("speeds are usual");
    Study::new(&Ring::new(plan))
}

/// Estimates whose mean and standard deviation follow from the truth.
pub(crate) fn estimated(
    study: &Study,
    of: impl Fn(&SleeperTruth, Parameter, f64) -> (f64, f64),
) -> Estimated {
    let sleeper = |sleeper: &SleeperTruth| {
        let mut fields = Map::new();
        fields.insert("id".to_owned(), json!(sleeper.id));
        fields.insert("flags".to_owned(), json!([]));
        for (&parameter, &truth) in &sleeper.values {
            let (mean, sd) = of(sleeper, parameter, truth);
            fields.insert(parameter.name().to_owned(), json!({"mean": mean, "sd": sd}));
        }
        Value::Object(fields)
    };
    let sleepers: Vec<Value> = study.truth.sleepers.iter().map(sleeper).collect();
    Estimated::read(&json!({ "sleepers": sleepers }).to_string()).expect("it is an evaluation")
}
