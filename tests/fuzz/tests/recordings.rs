use super::ITERATIONS;
use std::fs;
use tracktwin_signal::recording::Recording;
use tracktwin_signal::recording::import::Table;

/// Extensions of the supported file formats.
const KINDS: [&str; 6] = ["csv", "txt", "parquet", "npy", "npz", "mat"];

#[test]
fn a_table_is_read_or_refused() {
    let folder = tempfile::tempdir().unwrap();
    bolero::check!(name = "tables").with_iterations(ITERATIONS).for_each(|bytes: &[u8]| {
        let Some((kind, content)) = bytes.split_first() else { return };
        let extension = KINDS[usize::from(*kind) % KINDS.len()];
        let path = folder.path().join(format!("table.{extension}"));
        fs::write(&path, content).unwrap();
        drop(Table::read(&path));
    });
}

#[test]
fn a_recording_is_read_or_refused() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("pass.csv"), "t_s,x_m,a_m_s2\n0,1,2\n0.1,1.1,2\n").unwrap();
    bolero::check!(name = "recordings").with_iterations(ITERATIONS).for_each(|bytes: &[u8]| {
        fs::write(folder.path().join("recording.json"), bytes).unwrap();
        drop(Recording::open(folder.path()));
    });
}
