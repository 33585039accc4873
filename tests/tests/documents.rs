//! The programs accept every documented command and every setting in the deployment files. Every link
//! between pages leads to an existing file and heading.

#![expect(clippy::unwrap_used, reason = "in a test a panic is the report")]

use pulldown_cmark::{CodeBlockKind, CowStr, Event, Options, Parser, Tag, TagEnd};
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use system_tests::{Answer, run};

const PROGRAM: &str = env!("CARGO_BIN_EXE_tracktwin-under-test");
const WORKER: &str = env!("CARGO_BIN_EXE_tracktwin-worker-under-test");

/// All files with this extension in a folder and its subfolders.
fn files(folder: &Path, ending: &str) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(files(&path, ending));
        } else if path.extension().is_some_and(|it| it == ending) {
            found.push(path);
        }
    }
    found
}

/// All pages of the documentation.
fn pages(root: &Path) -> Vec<PathBuf> {
    let mut pages = files(&root.join("docs"), "md");
    let first = ["README.md", "CONTRIBUTING.md", "SECURITY.md", "CHANGELOG.md"];
    pages.extend(first.map(|it| root.join(it)));
    pages
}

/// Shell code of a page: its shell blocks, and inline code.
fn shell(page: &str) -> String {
    let mut shell = String::new();
    let mut in_shell = true;
    for event in Parser::new_ext(page, Options::ENABLE_TABLES) {
        match event {
            Event::Start(Tag::CodeBlock(kind)) => {
                in_shell = matches!(kind, CodeBlockKind::Fenced(of) if &*of == "sh");
            }
            Event::End(_) => in_shell = false,
            Event::Text(text) if in_shell => shell += &text,
            Event::Code(code) => shell.extend([&*code, "\n"]),
            _ => {}
        }
    }
    shell
}

/// The commands of this project: programs with their arguments.
fn commands(shell: &str) -> Vec<(&'static str, Vec<String>)> {
    let lines = shell.replace("\\\n", " ");
    let words = lines.lines().filter_map(shlex::split);
    let parts = words.flat_map(|words| {
        words
            .split(|it| matches!(it.as_str(), "&&" | "||" | "|" | "&" | ";"))
            .map(<[_]>::to_vec)
            .collect::<Vec<_>>()
    });
    parts.filter_map(command).collect()
}

/// Program and arguments of a command, from its words; `None` for other programs and for `tracktwin help`.
fn command(words: Vec<String>) -> Option<(&'static str, Vec<String>)> {
    let mut words = words.into_iter().take_while(|it| !it.starts_with('>'));
    let mut program = words.next()?;
    if program == "cargo" {
        // As in `cargo run --release -- ...`; examples are programs of their own.
        let options: Vec<_> = words.by_ref().take_while(|it| it != "--").collect();
        let ours = options.first().is_some_and(|it| it == "run")
            && !options.contains(&"--example".to_owned());
        program = if ours { "tracktwin".to_owned() } else { return None };
    }
    let program = match program.as_str() {
        "tracktwin" => PROGRAM,
        "tracktwin-worker" => WORKER,
        _ => return None,
    };
    let told: Vec<String> =
        words.map(|it| example(it.trim_matches(['[', ']'])).to_owned()).collect();
    (told.first().is_none_or(|it| it != "help")).then_some((program, told))
}

/// A valid value for a placeholder in the documentation.
fn example(word: &str) -> &str {
    match word {
        "INDEX" | "N" | "P" => "1",
        "PHYSICS" => "rail_joint",
        "SHELL" => "bash",
        word => word,
    }
}

#[test]
fn documented_commands_are_understood() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let of_pages =
        pages(&root).into_iter().map(|file| (shell(&fs::read_to_string(&file).unwrap()), file));
    let scripts = files(&root.join("docs"), "sh").into_iter();
    let of_scripts = scripts.map(|file| (fs::read_to_string(&file).unwrap(), file));
    let mut count = 0;
    for (shell, file) in of_pages.chain(of_scripts) {
        for (program, mut told) in commands(&shell) {
            // What follows is understood before help is given.
            told.push("--help".to_owned());
            let told: Vec<&str> = told.iter().map(String::as_str).collect();
            let answer = run(program, &told);
            assert_eq!(answer.code, Some(0), "{}: {told:?}: {}", file.display(), answer.err);
            count += 1;
        }
    }
    assert!(count > 50, "only {count} commands were found");
}

/// Names of this project's environment variables (`TRACKTWIN_...`) in a text.
fn settings(text: &str) -> BTreeSet<&str> {
    let words = text.split(|it: char| !(it.is_ascii_uppercase() || it == '_'));
    words.filter(|it| it.starts_with("TRACKTWIN_") && !it.ends_with('_')).collect()
}

#[test]
fn settings_of_deployed_programs_are_understood() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let helps = [run(PROGRAM, &["coordinator", "--help"]), run(WORKER, &["--help"])];
    let help: String = helps.into_iter().map(Answer::succeeded).collect();
    let known = settings(&help);
    let deployed = fs::read_dir(root.join("docs/deploy")).unwrap().map(|it| it.unwrap().path());
    let mut count = 0;
    for file in deployed.chain([root.join("docker-compose.yml")]) {
        for setting in settings(&fs::read_to_string(&file).unwrap()) {
            assert!(known.contains(setting), "{}: {setting}", file.display());
            count += 1;
        }
    }
    assert!(count > 10, "only {count} settings were found");
}

#[test]
fn what_containers_mount_exists() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let text = fs::read_to_string(root.join("docker-compose.yml")).unwrap();
    let mounted = text.split('"').filter(|it| it.starts_with("./")).map(|it| {
        let folder = it.split_once(':').unwrap().0;
        assert!(root.join(folder).exists(), "{folder}");
    });
    assert!(mounted.count() > 0);
}

/// The anchors of a page's headings, in the form that GitHub generates.
fn anchors(page: &str) -> BTreeSet<String> {
    let mut anchors = BTreeSet::new();
    let mut heading = String::new();
    for event in Parser::new_ext(page, Options::ENABLE_TABLES) {
        match event {
            Event::Start(Tag::Heading { .. }) => heading.clear(),
            Event::Text(text) | Event::Code(text) => heading += &text,
            Event::End(TagEnd::Heading(_)) => {
                let is_kept = |it: &char| it.is_alphanumeric() || matches!(it, '-' | '_');
                let words = heading.to_lowercase().replace(' ', "-");
                anchors.insert(words.chars().filter(is_kept).collect());
            }
            _ => {}
        }
    }
    anchors
}

/// The links of a page within the repository: path and anchor, either of which may be empty.
fn links(page: &str) -> Vec<(String, String)> {
    let events = Parser::new_ext(page, Options::ENABLE_TABLES);
    let targets = events.filter_map(|event| match event {
        Event::Start(Tag::Link { dest_url, .. } | Tag::Image { dest_url, .. }) => Some(dest_url),
        _ => None,
    });
    let parts = |it: CowStr<'_>| {
        let (path, anchor) = it.split_once('#').unwrap_or((&it, ""));
        (path.to_owned(), anchor.to_owned())
    };
    targets.filter(|it| !it.contains("://")).map(parts).collect()
}

#[test]
fn links_of_pages_lead_to_files_and_headings() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let mut count = 0;
    for page in pages(&root) {
        for (path, anchor) in links(&fs::read_to_string(&page).unwrap()) {
            let target = if path.is_empty() { page.clone() } else { page.with_file_name(&path) };
            assert!(target.exists(), "{}: {path}", page.display());
            let is_heading =
                || anchors(&fs::read_to_string(&target).unwrap()).contains(anchor.as_str());
            assert!(anchor.is_empty() || is_heading(), "{}: {path}#{anchor}", page.display());
            count += 1;
        }
    }
    assert!(count > 100, "only {count} links were found");
}
