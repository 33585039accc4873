//! The reader of an output may end early, as `head` does.

use std::io::Read;
use std::process::{Command, Stdio};

const PROGRAM: &str = env!("CARGO_BIN_EXE_tracktwin-under-test");

#[test]
fn an_answer_that_nobody_reads_to_its_end_is_no_failure() {
    for arguments in [&["completions", "bash"][..], &["run", "--print-campaign"]] {
        let mut program = Command::new(PROGRAM)
            .args(arguments)
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        // Gone before there is anything to read.
        drop(program.stdout.take());
        let mut err = String::new();
        program.stderr.take().unwrap().read_to_string(&mut err).unwrap();
        assert_eq!(program.wait().unwrap().code(), Some(0), "{arguments:?}: {err}");
        assert_eq!(err, "", "{arguments:?}");
    }
}
