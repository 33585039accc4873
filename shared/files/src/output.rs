//! Sets of files that are written together.

use crate::ownership::{Entry, LIST, List, hash};
use crate::partial::Staging;
use crate::single::sync_folder;
use crate::{FileName, FilesError, Kind, lock::Lock};
use std::fs::{File, OpenOptions};
use std::io::{ErrorKind, Write as _};
use std::os::unix::fs::OpenOptionsExt as _;
use std::path::{Path, PathBuf};

/// A set of files of one kind, written to a folder completely or not at all.
///
/// The files are first written to a hidden folder next to their final places. [`Output::commit`] renames
/// them after all are complete. A manifest is a file that names the others. A set with a manifest never
/// replaces one of the other files ([`Output::unique_name`]). The manifest is replaced in one step:
/// before this step the old set is complete, afterwards the new one. Unused files of the old set are
/// then removed. A file that the program did not write is replaced only with `force`.
#[derive(Debug)]
pub struct Output {
    folder: PathBuf,
    /// Folders created for the set, the innermost first.
    made: Vec<PathBuf>,
    kind: Kind,
    force: bool,
    staging: Option<Staging>,
    names: Vec<FileName>,
    manifest: Option<FileName>,
}

impl Output {
    /// Starts a set of files in `folder`, and creates the folder if it does not exist.
    ///
    /// # Errors
    /// [`FilesError::System`] if the folder cannot be created or written to.
    pub fn begin(folder: &Path, kind: Kind, force: bool) -> Result<Self, FilesError> {
        let missing =
            folder.ancestors().take_while(|it| !it.as_os_str().is_empty() && !it.exists());
        let made = missing.map(Path::to_owned).collect();
        make_folder(folder)?;
        let mut output = Self::in_folder(folder, kind, force)?;
        output.made = made;
        Ok(output)
    }

    /// Starts a set of files in an existing folder.
    ///
    /// # Errors
    /// [`FilesError::System`] if the folder does not exist or cannot be written to.
    pub fn in_folder(folder: &Path, kind: Kind, force: bool) -> Result<Self, FilesError> {
        Ok(Self {
            folder: folder.to_owned(),
            made: Vec::new(),
            kind,
            force,
            staging: Some(Staging::new(folder)?),
            names: Vec::new(),
            manifest: None,
        })
    }

    /// Path to which the caller must write the file with the final name `name`.
    pub fn stage(&mut self, name: &FileName) -> PathBuf {
        if !self.names.contains(name) {
            self.names.push(name.clone());
        }
        self.staged(name)
    }

    /// Adds a file. The function `write` receives the path and must write the file.
    ///
    /// # Errors
    /// [`FilesError::System`] with the error of `write`.
    pub fn fill<E: Into<Box<dyn std::error::Error + Send + Sync>>>(
        &mut self,
        name: &FileName,
        write: impl FnOnce(&Path) -> Result<(), E>,
    ) -> Result<(), FilesError> {
        let path = self.stage(name);
        let place = name.within(&self.folder);
        write(&path).map_err(|error| FilesError::written(&place)(std::io::Error::other(error)))
    }

    /// Adds a file.
    ///
    /// # Errors
    /// [`FilesError::System`] if the file cannot be written.
    pub fn add(&mut self, name: &FileName, bytes: &[u8]) -> Result<(), FilesError> {
        let path = self.stage(name);
        std::fs::write(path, bytes).map_err(FilesError::written(&name.within(&self.folder)))
    }

    /// Adds a file that only its owner can read.
    ///
    /// # Errors
    /// [`FilesError::System`] if the file cannot be written.
    pub fn add_secret(&mut self, name: &FileName, bytes: &[u8]) -> Result<(), FilesError> {
        let path = self.stage(name);
        let file = OpenOptions::new().write(true).create_new(true).mode(0o600).open(path);
        let written = file.and_then(|mut file| file.write_all(bytes));
        written.map_err(FilesError::written(&name.within(&self.folder)))
    }

    /// Adds the manifest: the file that names the others. It is renamed last.
    ///
    /// # Errors
    /// [`FilesError::System`] if the file cannot be written.
    pub fn add_manifest(&mut self, name: &FileName, bytes: &[u8]) -> Result<(), FilesError> {
        self.add(name, bytes)?;
        self.manifest = Some(name.clone());
        Ok(())
    }

    /// Final name of a staged file that does not replace another content: `name`, or `name` with digits
    /// of the hash of the content if an existing file with this name has another content.
    ///
    /// # Errors
    /// [`FilesError::System`] if the file cannot be read.
    pub fn unique_name(&mut self, name: &FileName) -> Result<FileName, FilesError> {
        let content = hash(&self.staged(name))?;
        if self.stands(name, &content)? {
            return Ok(name.clone());
        }
        let marked = name.marked(&content);
        let [from, to] = [name, &marked].map(|it| self.staged(it));
        std::fs::rename(from, to).map_err(FilesError::written(&marked.within(&self.folder)))?;
        self.names.retain(|it| it != name);
        self.names.push(marked.clone());
        Ok(marked)
    }

    /// Checks that no existing file prevents [`Output::commit`].
    ///
    /// # Errors
    /// The errors of [`Output::commit`].
    pub fn check(&self) -> Result<(), FilesError> {
        let list = List::of(&self.folder);
        for name in &self.names {
            self.replaced(&list, name, &hash(&self.staged(name))?)?;
        }
        Ok(())
    }

    /// Renames all files to their final names.
    ///
    /// # Errors
    /// [`FilesError::Foreign`], [`FilesError::OtherKind`] or [`FilesError::Folder`] for an existing file
    /// that must not be replaced; [`FilesError::System`] for an error of the operating system. The old
    /// files are then kept.
    pub fn commit(mut self) -> Result<(), FilesError> {
        let _others_wait = Lock::wait(&self.folder);
        if let Some(manifest) = self.manifest.clone() {
            self.names.retain(|name| *name != manifest);
            self.names.push(manifest);
        }
        let mut list = List::of(&self.folder);
        let mut moved = Vec::new();
        for name in &self.names {
            let staged = self.staged(name);
            let path = name.within(&self.folder);
            sync(&staged).map_err(FilesError::written(&path))?;
            let new = hash(&staged)?;
            if let Some(old) = self.replaced(&list, name, &new)? {
                let entry = list.files.remove(name.as_str());
                let mut contents = entry.map(|entry| entry.blake3).unwrap_or_default();
                // Whoever dies between the list and the file leaves either content.
                contents.retain(|content| *content == old);
                contents.insert(new);
                let entry = Entry { kind: self.kind, blake3: contents };
                list.files.insert(name.as_str().to_owned(), entry);
                moved.push((staged, path));
            }
        }
        self.place(list, moved)?;
        self.made.clear();
        Ok(())
    }

    /// The list first: a file that is on it and not yet there does no harm.
    fn place(&self, mut list: List, moved: Vec<(PathBuf, PathBuf)>) -> Result<(), FilesError> {
        let leftovers = self.leftovers(&list);
        if moved.is_empty() && leftovers.is_empty() {
            return Ok(());
        }
        self.put(&list)?;
        for (staged, path) in moved {
            std::fs::rename(staged, &path).map_err(FilesError::written(&path))?;
        }
        sync_folder(&self.folder);
        for name in leftovers {
            // One that can't be removed stays on the list.
            if std::fs::remove_file(self.folder.join(&name)).is_ok() {
                list.files.remove(&name);
            }
        }
        self.put(&list)
    }

    /// Writes the list of the folder's own files.
    fn put(&self, list: &List) -> Result<(), FilesError> {
        let place = self.folder.join(LIST);
        let staged = self.staging().join(LIST);
        let put = || -> std::io::Result<()> {
            std::fs::write(&staged, list.to_json())?;
            sync(&staged)?;
            std::fs::rename(&staged, &place)
        };
        put().map_err(FilesError::written(&place))
    }

    /// Own files of the kind that a set with a manifest no longer has, unchanged.
    fn leftovers(&self, list: &List) -> Vec<String> {
        if self.manifest.is_none() {
            return Vec::new();
        }
        let is_left = |(name, entry): &(&String, &Entry)| {
            entry.kind == self.kind
                && self.names.iter().all(|it| it.as_str() != name.as_str())
                && hash(&self.folder.join(name)).is_ok_and(|it| entry.blake3.contains(&it))
        };
        list.files.iter().filter(is_left).map(|(name, _)| name.clone()).collect()
    }

    /// The hash of what a new content replaces, empty for nothing; `None` where it is there already.
    fn replaced(
        &self,
        list: &List,
        name: &FileName,
        new: &str,
    ) -> Result<Option<String>, FilesError> {
        let path = name.within(&self.folder);
        match std::fs::symlink_metadata(&path) {
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(Some(String::new())),
            Err(source) => return Err(FilesError::written(&path)(source)),
            Ok(found) if found.is_dir() => return Err(FilesError::Folder { path }),
            Ok(_) => {}
        }
        let old = hash(&path)?;
        if old == new {
            return Ok(None);
        }
        if !self.force {
            list.allows(name.as_str(), self.kind, &path)?;
        }
        Ok(Some(old))
    }

    /// Whether a name is free, or has this very content.
    fn stands(&self, name: &FileName, content: &str) -> Result<bool, FilesError> {
        let path = name.within(&self.folder);
        match std::fs::symlink_metadata(&path) {
            Err(error) if error.kind() == ErrorKind::NotFound => Ok(true),
            Ok(found) if found.is_file() => Ok(hash(&path)? == content),
            _ => Ok(false),
        }
    }

    fn staged(&self, name: &FileName) -> PathBuf {
        name.within(self.staging())
    }

    fn staging(&self) -> &Path {
        self.staging.as_ref().expect("it is there from begin to commit").path()
    }
}

impl Drop for Output {
    fn drop(&mut self) {
        self.staging = None;
        for folder in &self.made {
            // Made for what did not come; one that others use meanwhile stays.
            let _ = std::fs::remove_dir(folder);
        }
    }
}

/// Creates a folder and its parent folders.
///
/// # Errors
/// [`FilesError::System`] names the folder.
pub fn make_folder(folder: &Path) -> Result<(), FilesError> {
    std::fs::create_dir_all(folder).map_err(FilesError::system(folder, "made"))
}

/// Flushes the content of a file to the disk, so that it survives a power failure.
fn sync(path: &Path) -> std::io::Result<()> {
    File::open(path)?.sync_all()
}
