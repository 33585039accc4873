//! Rules that the compiler does not check: dependencies of crates, sizes of files, words.

#![expect(clippy::unwrap_used, reason = "in a test a panic is the report")]

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// Crates, with the crates that they must not depend on, directly or indirectly.
const BORDERS: &[(&str, &[&str])] = &[
    (
        "tracktwin-farm",
        &[
            "tracktwin-surrogate",
            "tracktwin-evaluation",
            "tracktwin-inspection",
            "tracktwin-diagnosis",
            "tracktwin-report",
            "tracktwin-trial",
            "tracktwin-reproduction",
            "tracktwin-reference-simulator",
        ],
    ),
    ("tracktwin-worker", &["tracktwin-library", "tracktwin-farm", "sqlx"]),
    ("tracktwin-library", &["tracktwin-farm", "tracktwin-worker", "tracktwin-surrogate"]),
    ("tracktwin-surrogate", OUTSIDE_THE_TWIN),
    ("tracktwin-evaluation", OUTSIDE_THE_TWIN),
    ("tracktwin-inspection", OUTSIDE_THE_TWIN),
    ("tracktwin-inspection", &["tracktwin-diagnosis", "tracktwin-surrogate"]),
    ("tracktwin-diagnosis", OUTSIDE_THE_TWIN),
    ("tracktwin-diagnosis", &["tracktwin-inversion", "tracktwin-surrogate"]),
    ("tracktwin-inversion", OUTSIDE_THE_TWIN),
    ("tracktwin-hammer", OUTSIDE_THE_TWIN),
    // What tests the twin may not be the twin.
    (
        "tracktwin-reference-simulator",
        &["tracktwin-track", "tracktwin-diagnosis", "tracktwin-worker"],
    ),
    ("tracktwin-second-simulator", &["tracktwin-track", "tracktwin-diagnosis", "tracktwin-worker"]),
    (
        "tracktwin-ring",
        &["tracktwin-library", "tracktwin-farm", "tracktwin-worker", "tracktwin-report"],
    ),
    (
        "tracktwin-report",
        &["tracktwin-library", "tracktwin-farm", "tracktwin-worker", "tonic", "sqlx"],
    ),
    ("tracktwin-drawing", &["tracktwin-signal", "tracktwin-track", "tracktwin-evaluation"]),
    ("tracktwin-track", &["tracktwin-signal", "tracktwin-experiment", "tokio"]),
    ("tracktwin-experiment", &["tracktwin-protocol", "tokio", "tonic"]),
];

/// The twin does not depend on the library, the network, or the crates that test it.
const OUTSIDE_THE_TWIN: &[&str] = &[
    "tracktwin-library",
    "tracktwin-farm",
    "tracktwin-worker",
    "tracktwin-protocol",
    "tracktwin-report",
    "tracktwin-trial",
    "tracktwin-reference-simulator",
    "tracktwin-second-simulator",
    "tokio",
];

/// External libraries, with the only crates that may use them.
const KEPT_TO: &[(&str, &[&str])] = &[
    ("sqlx", &["tracktwin-library"]),
    ("tonic", &["tracktwin-protocol", "tracktwin-worker", "tracktwin-farm"]),
    ("axum", &["tracktwin-worker", "tracktwin-farm"]),
    ("anyhow", &["tracktwin", "tracktwin-worker"]),
    ("clap", &["tracktwin", "tracktwin-worker"]),
];

/// Files in which `anyhow` is allowed: commands.
const ANYHOW_IN: &[&str] = &["coordinator/src/commands/", "worker/src/command.rs"];

/// Maximum number of lines of a source file; more for an enum of errors, which cannot be split.
const FILE_LINES_MAX: usize = 400;
const ERRORS_LINES_MAX: usize = 450;
/// Maximum number of characters of a line in the documentation, except tables and code.
const PAGE_LINE_MAX: usize = 130;

/// A file that a how-to creates as an example.
const WORKED_EXAMPLE: &str = "shared/track/src/extension/sleeper_damper.rs";

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// All files with this extension in a folder and its subfolders, except build outputs.
fn files(folder: &Path, extension: &str) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            let name = path.file_name().unwrap().to_string_lossy().into_owned();
            if path.is_dir() {
                if name != "target" && !name.starts_with('.') {
                    folders.push(path);
                }
            } else if path.extension().is_some_and(|it| it == extension) {
                found.push(path);
            }
        }
    }
    found
}

/// Direct dependencies of each crate of the workspace, without development dependencies.
fn uses() -> BTreeMap<String, BTreeSet<String>> {
    let manifests = files(&root(), "toml").into_iter().filter(|it| it.ends_with("Cargo.toml"));
    let mut uses = BTreeMap::new();
    for manifest in manifests {
        let manifest: toml::Table = fs::read_to_string(manifest).unwrap().parse().unwrap();
        let Some(name) = manifest.get("package").and_then(|it| it["name"].as_str()) else {
            continue;
        };
        let dependencies = manifest.get("dependencies").and_then(|it| it.as_table());
        let names = dependencies.into_iter().flat_map(|it| it.keys().cloned()).collect();
        uses.insert(name.to_owned(), names);
    }
    uses
}

/// All direct and indirect dependencies of a crate.
fn reached<'a>(name: &'a str, uses: &'a BTreeMap<String, BTreeSet<String>>) -> BTreeSet<&'a str> {
    let mut reached = BTreeSet::new();
    let mut open = vec![name];
    while let Some(name) = open.pop() {
        for used in uses.get(name).into_iter().flatten() {
            if reached.insert(used.as_str()) {
                open.push(used);
            }
        }
    }
    reached
}

#[test]
fn no_crate_reaches_over_its_border() {
    let uses = uses();
    for (name, forbidden) in BORDERS {
        assert!(uses.contains_key(*name), "{name} is no crate");
        let reached = reached(name, &uses);
        let over: Vec<_> = forbidden.iter().filter(|it| reached.contains(**it)).collect();
        assert!(over.is_empty(), "{name} reaches {over:?}");
    }
}

#[test]
fn databases_networks_and_arguments_stay_where_they_belong() {
    let uses = uses();
    let examinations = |name: &str| name.contains("test") || name == "tracktwin-benches";
    for (library, allowed) in KEPT_TO {
        let users = uses.iter().filter(|(_, used)| used.contains(*library)).map(|(name, _)| name);
        for user in users.filter(|user| !examinations(user)) {
            assert!(allowed.contains(&user.as_str()), "{user} uses {library}");
        }
    }
}

#[test]
fn anyhow_is_for_commands() {
    let root = root();
    for file in files(&root, "rs") {
        let place = file.strip_prefix(&root).unwrap().to_string_lossy().into_owned();
        let text = fs::read_to_string(&file).unwrap();
        let tells = text.lines().any(|it| it.contains("anyhow::") && !it.contains("\"anyhow"));
        let allowed = ANYHOW_IN.iter().any(|folder| place.starts_with(folder));
        assert!(!tells || allowed || place.ends_with("tidy.rs"), "{place} uses anyhow");
    }
}

#[test]
fn files_stay_short() {
    let root = root();
    for file in files(&root, "rs") {
        let lines = fs::read_to_string(&file).unwrap().lines().count();
        let most = if file.ends_with("error.rs") { ERRORS_LINES_MAX } else { FILE_LINES_MAX };
        assert!(lines <= most, "{}: {lines} lines", file.display());
    }
}

#[test]
fn lines_of_pages_stay_short() {
    let root = root();
    let mut pages = files(&root.join("docs"), "md");
    pages.push(root.join("README.md"));
    for page in pages {
        let mut code = false;
        for (number, line) in (1..).zip(fs::read_to_string(&page).unwrap().lines()) {
            let line = line.trim_start();
            code ^= line.starts_with("```");
            let prose = !code && !line.starts_with('|');
            let long = prose && line.chars().count() > PAGE_LINE_MAX;
            assert!(!long, "{}:{number}: longer than {PAGE_LINE_MAX}", page.display());
        }
    }
}

/// Paths of this repository in the code spans and links of a page.
fn named_paths(text: &str) -> Vec<&str> {
    let spans = text.split('`').skip(1).step_by(2);
    let inside = ["coordinator/", "shared/", "worker/", "tests/", "docs/", "migrations/", "proto/"];
    spans
        .filter(|span| inside.iter().any(|folder| span.starts_with(folder)))
        .filter(|span| !span.contains([' ', '*', '{', '<', '$', '…']))
        .collect()
}

#[test]
fn paths_that_pages_name_are_there() {
    let root = root();
    let mut count = 0;
    for page in files(&root.join("docs"), "md") {
        for path in named_paths(&fs::read_to_string(&page).unwrap()) {
            let is_there = root.join(path).exists() || path == WORKED_EXAMPLE;
            assert!(is_there, "{}: {path}", page.display());
            count += 1;
        }
    }
    assert!(count > 40, "only {count} paths were found");
}

/// The words in bold in the last column of the glossary's tables. They must appear nowhere.
fn banned_words(glossary: &str) -> Vec<&str> {
    let last_columns = glossary.lines().filter_map(|line| {
        let mut cells = line.strip_prefix('|')?.strip_suffix('|')?.split('|');
        cells.nth(3)
    });
    last_columns.flat_map(|column| column.split("**").skip(1).step_by(2)).collect()
}

/// All comments of a source file as one text.
fn comments(source: &str) -> String {
    let lines = source.lines().filter_map(|line| line.trim_start().strip_prefix("//"));
    lines.map(|line| line.trim_start_matches(['/', '!'])).collect::<Vec<_>>().join(" ")
}

/// Whether a text contains a word or its plural; both must be in lower case.
fn has_word(text: &str, word: &str) -> bool {
    let is_part = |neighbour: char| neighbour.is_alphanumeric() || "-_".contains(neighbour);
    text.match_indices(word).any(|(at, _)| {
        let rest = &text[at + word.len()..];
        let rest = rest.strip_prefix('s').unwrap_or(rest);
        !text[..at].ends_with(is_part) && !rest.starts_with(is_part)
    })
}

#[test]
fn words_of_the_glossary_that_are_banned_appear_nowhere() {
    let root = root();
    let read = |path: &Path| fs::read_to_string(path).unwrap();
    let glossary = read(&root.join("docs/glossary.md"));
    let banned = banned_words(&glossary);
    assert!(banned.len() > 40, "only {} words are banned", banned.len());
    let mut pages = files(&root.join("docs"), "md");
    pages.retain(|page| !page.ends_with("glossary.md"));
    let others = ["README.md", "CONTRIBUTING.md", "SECURITY.md"];
    pages.extend(others.map(|page| root.join(page)));
    // Help is kept as it is printed.
    pages.extend(["help.txt", "worker-help.txt"].map(|it| root.join("tests/snapshots").join(it)));
    let pages = pages.into_iter().map(|page| (read(&page), page));
    let sources = files(&root, "rs").into_iter().map(|file| (comments(&read(&file)), file));
    for (text, file) in pages.chain(sources) {
        let text = text.split_whitespace().collect::<Vec<_>>().join(" ").to_lowercase();
        for word in &banned {
            let is_there = has_word(&text, &word.to_lowercase());
            assert!(!is_there, "{}: \"{word}\"; see docs/glossary.md", file.display());
        }
    }
}

#[test]
fn a_word_is_found_in_its_plural_and_not_inside_others() {
    assert!(has_word("two exams, one exam", "exam") && has_word("spots", "spot"));
    assert!(!has_word("for example", "exam") && !has_word("spot_m and hot-spot", "spot"));
    assert_eq!(banned_words("| a | b | c | **d e**, f, **g** |\n| x |"), ["d e", "g"]);
    assert_eq!(comments("/// One\nlet two = 2; // three\n    // four"), " One  four");
}
