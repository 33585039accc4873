//! File systems without working locks, as on some clusters.

use crate::farm::PROGRAM;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use test_needs::skipped;

/// C code of a library that makes system calls for locks fail, as on a file system without locks. With
/// `ONLY_FLOCK` set, only locks on whole files fail.
const NO_LOCKS: &str = r#"
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdlib.h>
#include <sys/file.h>

int flock(int file, int how) {
    errno = ENOSYS;
    return -1;
}

static int refuse(int command) {
    return (command == F_SETLK || command == F_SETLKW) && !getenv("ONLY_FLOCK");
}

#define FCNTL(name) \
    int name(int file, int command, ...) { \
        va_list list; \
        va_start(list, command); \
        void *argument = va_arg(list, void *); \
        va_end(list); \
        if (refuse(command)) { errno = ENOSYS; return -1; } \
        int (*real)(int, int, ...) = dlsym(RTLD_NEXT, #name); \
        return real(file, command, argument); \
    }
FCNTL(fcntl)
FCNTL(fcntl64)
"#;

/// Compiles the library; `None` without a C compiler.
fn no_locks(folder: &Path) -> Option<PathBuf> {
    let (source, library) = (folder.join("no_locks.c"), folder.join("no_locks.so"));
    std::fs::write(&source, NO_LOCKS).unwrap();
    let mut compile = Command::new("cc");
    compile.args(["-shared", "-fPIC", "-o"]).args([&library, &source]).arg("-ldl");
    if compile.output().is_ok_and(|output| output.status.success()) {
        return Some(library);
    }
    skipped("file systems without locks; install a C compiler");
    None
}

/// Output of a run with this library.
fn run_without_locks(environment: &[(&str, &str)]) -> Option<Output> {
    let folder = tempfile::tempdir().unwrap();
    let no_locks = no_locks(folder.path())?;
    let mut run = Command::new(PROGRAM);
    run.args(["run", "--cases", "8", "--no-train", "--out"]).arg(folder.path().join("out"));
    run.env("LD_PRELOAD", no_locks).envs(environment.iter().copied());
    Some(run.output().unwrap())
}

fn assert_told(output: &Output) {
    let err = String::from_utf8_lossy(&output.stderr);
    let last = err.lines().last().unwrap_or_default();
    for word in ["library.sqlite", "locks do not work", "a local disk", "postgres://"] {
        assert!(last.contains(word), "`{word}` is missing in: {err}");
    }
    assert_eq!(output.status.code(), Some(2), "{err}");
}

#[test]
fn a_library_whose_file_cannot_be_locked_is_refused_with_the_way_out() {
    let Some(output) = run_without_locks(&[]) else { return };
    assert_told(&output);
}

#[test]
fn a_library_that_keeps_no_other_coordinator_away_is_refused_with_the_way_out() {
    let Some(output) = run_without_locks(&[("ONLY_FLOCK", "1")]) else { return };
    assert_told(&output);
}
