//! How well a library's parameters are told with each scaling of the inputs alone: the test errors
//! of the models that `tracktwin train` would choose among, and at the end what it chooses.
//!
//! `cargo run --release -p tracktwin --example scalings -- sqlite:PATH`
//!
//! `docs/decisions/0034-inputs-of-the-regression.md` shows what comes out.

#![expect(clippy::print_stdout, reason = "an example shows its numbers")]

use tracktwin::pipeline;
use tracktwin_library::Library;
use tracktwin_surrogate::{TrainOptions, train};

#[tokio::main]
async fn main() -> Result<(), Box<dyn std::error::Error>> {
    let url = std::env::args().nth(1).ok_or("which library? sqlite:PATH or postgres://...")?;
    let library = Library::open(&url).await?;
    let campaigns = library.campaigns().await?;
    let campaign = campaigns.first().ok_or("the library holds no campaign")?;
    let set = pipeline::train::set(&library, campaign, None).await?;
    let usual = pipeline::train::options(&set);
    let whole = usual.features[..1].to_vec();
    println!(
        "Test MASE in %: {}",
        set.varied.iter().map(|p| p.symbol()).collect::<Vec<_>>().join(" ")
    );
    let each = usual.scalings.iter().map(|&scaling| vec![scaling]);
    for scalings in each.chain([usual.scalings.clone()]) {
        let name = format!("{scalings:?}");
        let options = TrainOptions { scalings, ..TrainOptions::new(whole.clone()) };
        for group in train(&set, &options, &|_| ())?.groups() {
            let errors =
                group.models().iter().map(|it| format!("{:.1}", 100.0 * it.score.mase_test));
            println!(
                "{:?} {name}: {}",
                group.key().speeds_km_h,
                errors.collect::<Vec<_>>().join(" ")
            );
        }
    }
    Ok(())
}
