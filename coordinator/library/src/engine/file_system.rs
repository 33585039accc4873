//! Detection of file systems that are unsuitable for a library in a file.

use std::path::Path;

/// File systems that several machines may share: magic number of `statfs(2)`, and name.
///
/// There, the locks of `SQLite` and the shared memory of its log work at most between processes of one
/// machine, and on some file systems not at all.
const SHARED: [(u32, &str); 15] = [
    (0x0000_6969, "NFS"),
    (0x0000_517b, "SMB"),
    (0xfe53_4d42, "SMB"),
    (0xff53_4d42, "CIFS"),
    (0x0bd0_0bd0, "Lustre"),
    (0x1983_0326, "BeeGFS"),
    (0x4750_4653, "GPFS"),
    (0x00c3_6400, "CephFS"),
    (0xaad7_aaea, "PanFS"),
    (0x7461_636f, "OCFS2"),
    (0x0116_1970, "GFS2"),
    (0x5346_414f, "AFS"),
    (0x0102_1997, "9P"),
    (0x786f_4256, "a virtual machine's shared folder"),
    (0x6573_5546, "FUSE"),
];

/// Name of the file system at a path, if several machines may share it; otherwise `None`.
pub(crate) fn shared_between_hosts(path: &Path) -> Option<&'static str> {
    // A file that is still to be made lies where its folder does.
    let place = path.ancestors().find(|it| it.exists()).filter(|it| !it.as_os_str().is_empty());
    let found = rustix::fs::statfs(place.unwrap_or(Path::new("."))).ok()?;
    name(found.f_type as u32)
}

pub(crate) fn is_shared_between_hosts(path: &Path) -> bool {
    shared_between_hosts(path).is_some()
}

fn name(magic: u32) -> Option<&'static str> {
    SHARED.iter().find(|(number, _)| *number == magic).map(|(_, name)| *name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn network_file_systems_are_known_and_local_ones_are_none() {
        for (magic, known) in [(0x6969, Some("NFS")), (0x0bd0_0bd0, Some("Lustre")), (0xef53, None)]
        {
            assert_eq!(name(magic), known);
        }
    }

    #[test]
    fn a_file_to_be_made_is_looked_for_where_its_folder_is() {
        let proc = Path::new("/proc/no/such/file");
        assert_eq!(shared_between_hosts(proc), None);
        assert!(!is_shared_between_hosts(Path::new("not-there.sqlite")));
    }
}
