//! Location of PostgreSQL's programs, and the user that runs them.

use std::path::{Path, PathBuf};
use std::process::Command;

/// Folder of Debian's packages, with one folder per version.
const DEBIAN: &str = "/usr/lib/postgresql";

/// Folder of `initdb` and `postgres`: `$PG_BIN`, the newest version of Debian, or a folder on the `PATH`.
pub(crate) fn programs() -> Option<PathBuf> {
    let given = std::env::var_os("PG_BIN").map(PathBuf::from);
    let path = std::env::var_os("PATH").unwrap_or_default();
    given.into_iter().chain(debian()).chain(std::env::split_paths(&path)).find(|it| is_complete(it))
}

fn debian() -> Vec<PathBuf> {
    let mut versions: Vec<(u32, PathBuf)> = std::fs::read_dir(DEBIAN)
        .into_iter()
        .flatten()
        .flatten()
        .filter_map(|entry| {
            let version = entry.file_name().to_str()?.parse().ok()?;
            Some((version, entry.path().join("bin")))
        })
        .collect();
    versions.sort();
    versions.into_iter().rev().map(|(_, folder)| folder).collect()
}

fn is_complete(folder: &Path) -> bool {
    ["initdb", "postgres", "createdb"].iter().all(|program| folder.join(program).is_file())
}

/// A command that runs as a user accepted by the server, which refuses to run as root.
pub(crate) fn as_somebody(program: &Path) -> Command {
    if !is_root() {
        return Command::new(program);
    }
    let user = if exists("postgres") { "postgres" } else { "nobody" };
    let mut command = Command::new("setpriv");
    command.arg(format!("--reuid={user}")).arg(format!("--regid={}", group(user)));
    command.arg("--clear-groups").arg(program);
    command
}

fn is_root() -> bool {
    answer("-u", None).as_deref() == Some("0")
}

fn exists(user: &str) -> bool {
    answer("-u", Some(user)).is_some()
}

fn group(user: &str) -> String {
    answer("-g", Some(user)).unwrap_or_else(|| user.to_owned())
}

/// Output of `id` with this option.
fn answer(option: &str, user: Option<&str>) -> Option<String> {
    let output = Command::new("id").arg(option).args(user).output().ok()?;
    output.status.success().then(|| String::from_utf8_lossy(&output.stdout).trim().to_owned())
}
