//! Files that other files name.

use crate::FilesError;
use std::path::{Component, Path, PathBuf};

/// The path of a file that another file in `folder` refers to as `name`. The path must be relative and
/// must stay in the folder after links are resolved. The function returns the path of a missing file
/// unchanged.
///
/// # Errors
/// [`FilesError::Outside`] for an absolute path, for one with `..`, and for a link that leads out.
pub fn inside(folder: &Path, name: &str) -> Result<PathBuf, FilesError> {
    let outside = || FilesError::Outside { folder: folder.to_owned(), name: name.to_owned() };
    let mut parts = Path::new(name).components().peekable();
    let stays = parts.peek().is_some()
        && parts.all(|part| matches!(part, Component::Normal(_)))
        && !name.contains(char::is_control);
    if !stays {
        return Err(outside());
    }
    let path = folder.join(name);
    let (Ok(real), Ok(real_folder)) = (path.canonicalize(), folder.canonicalize()) else {
        // Opening it reports the error.
        return Ok(path);
    };
    if real.starts_with(real_folder) { Ok(path) } else { Err(outside()) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::symlink;

    #[test]
    fn a_name_stays_in_its_folder() {
        let home = tempfile::tempdir().unwrap();
        let folder = home.path().join("recording");
        std::fs::create_dir_all(folder.join("passes")).unwrap();
        std::fs::write(home.path().join("secret.csv"), "").unwrap();
        for good in ["pass.csv", "passes/1.csv", "a..b.csv", "not-there.parquet", "..csv"] {
            assert_eq!(inside(&folder, good).unwrap(), folder.join(good));
        }
        let secret = home.path().join("secret.csv").display().to_string();
        for wrong in ["", ".", "..", "../secret.csv", "passes/../../secret.csv", "/etc/passwd"] {
            inside(&folder, wrong).unwrap_err();
        }
        inside(&folder, &secret).unwrap_err();
        inside(&folder, "a\nb").unwrap_err();
    }

    #[test]
    fn a_link_is_followed_only_within_the_folder() {
        let home = tempfile::tempdir().unwrap();
        let folder = home.path().join("recording");
        std::fs::create_dir(&folder).unwrap();
        std::fs::write(folder.join("pass.csv"), "").unwrap();
        std::fs::write(home.path().join("secret.csv"), "").unwrap();
        symlink("pass.csv", folder.join("same.csv")).unwrap();
        symlink("../secret.csv", folder.join("out.csv")).unwrap();
        symlink(home.path(), folder.join("up")).unwrap();
        inside(&folder, "same.csv").unwrap();
        inside(&folder, "out.csv").unwrap_err();
        inside(&folder, "up/secret.csv").unwrap_err();
        // The folder itself may be reached by a link.
        symlink(&folder, home.path().join("link")).unwrap();
        inside(&home.path().join("link"), "pass.csv").unwrap();
    }
}
