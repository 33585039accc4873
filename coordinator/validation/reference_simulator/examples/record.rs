//! Makes a recording of a scene: `record SCENE.json FOLDER`, or `record typical:SEED FOLDER`.
//!
//! With a second file, `record typical:SEED FOLDER HIDDEN.json`, the effects listed there are hidden in
//! the scene. The program prints the scene, because the recording does not contain the truth.

use std::path::Path;
use std::process::ExitCode;
use tracktwin_reference_simulator::{Hidden, Scene};

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match run(&arguments) {
        Ok(scene) => {
            println!("{scene}");
            ExitCode::SUCCESS
        }
        Err(reason) => {
            eprintln!("error: {reason}");
            ExitCode::from(2)
        }
    }
}

fn run(arguments: &[String]) -> Result<String, Box<dyn std::error::Error>> {
    let [source, folder, hidden @ ..] = arguments else {
        return Err("write: record SCENE.json|typical:SEED FOLDER [HIDDEN.json]".into());
    };
    let mut scene: Scene = match source.strip_prefix("typical:") {
        Some(seed) => Scene::typical(seed.parse()?),
        None => serde_json::from_str(&std::fs::read_to_string(source)?)?,
    };
    if let [hidden] = hidden {
        let more: Vec<Hidden> = serde_json::from_str(&std::fs::read_to_string(hidden)?)?;
        scene.left_out.extend(more);
    }
    tracktwin_reference_simulator::record(&scene, Path::new(folder))?;
    Ok(serde_json::to_string_pretty(&scene)?)
}
