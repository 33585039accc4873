//! Names of workers that survive a restart: host name and number of the worker on its host.

use std::fs::{File, OpenOptions};
use std::path::Path;

/// Maximum number of workers of a host with such a name.
const SLOTS_MAX: u32 = 1024;

/// A worker's place on its host. It is free again when this value is dropped or the process ends.
#[derive(Debug)]
pub(crate) struct Slot {
    /// Name of the worker: host name and number.
    pub(crate) name: String,
    _lock: File,
}

impl Slot {
    /// Takes the lowest free number of this host; `None` if the host has no name, or if no file of the
    /// temporary folder can be locked.
    pub(crate) fn take() -> Option<Self> {
        Self::take_in(&std::env::temp_dir(), &host()?)
    }

    fn take_in(folder: &Path, host: &str) -> Option<Self> {
        (1..=SLOTS_MAX).find_map(|number| {
            let path = folder.join(format!("tracktwin-worker-{number}.lock"));
            let file =
                OpenOptions::new().write(true).create(true).truncate(false).open(path).ok()?;
            file.try_lock().ok()?;
            Some(Self { name: format!("{host}-{number}"), _lock: file })
        })
    }
}

/// Name of this host, if it has one.
pub(crate) fn host() -> Option<String> {
    let host = std::fs::read_to_string("/proc/sys/kernel/hostname").ok()?;
    Some(host.trim().to_owned()).filter(|host| !host.is_empty())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn workers_of_a_host_have_different_names_and_a_restart_has_the_same() {
        let folder = std::env::temp_dir().join(crate::config::unique_name());
        std::fs::create_dir(&folder).unwrap();
        let take = || Slot::take_in(&folder, "node-7").unwrap();
        let (first, second) = (take(), take());
        assert_eq!([&first.name, &second.name], ["node-7-1", "node-7-2"]);
        drop(first);
        assert_eq!(take().name, "node-7-1");
        std::fs::remove_dir_all(&folder).unwrap();
        assert!(Slot::take_in(&folder, "node-7").is_none(), "there is no folder");
    }
}
