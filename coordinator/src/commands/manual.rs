//! `tracktwin manual`: a manual page for every command.

use super::files::{Force, check};
use super::{Program, Stop, println_stdout};
use clap::{Args, Command, CommandFactory};
use clap_mangen::Man;
use std::path::PathBuf;
use tracktwin_files::{FileName, Kind, Output};

/// Arguments of `manual`.
#[derive(Args)]
#[command(after_help = "\
Example:
  tracktwin manual --out ~/.local/share/man/man1

After that, `man tracktwin` and, for example, `man tracktwin-library-copy` show the pages.")]
pub(super) struct Arguments {
    /// Output folder; every command has its own page.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    #[command(flatten)]
    force: Force,
}

pub(super) fn run(arguments: &Arguments) -> Result<(), Stop> {
    let Arguments { out, force } = arguments;
    let pages = pages()?;
    let names: Vec<&str> = pages.iter().map(|(name, _)| name.as_str()).collect();
    check(out, Kind::Manual, *force, &names)?;
    let mut output = Output::begin(out, Kind::Manual, force.force)?;
    for (name, page) in &pages {
        output.add(name, page)?;
    }
    output.commit()?;
    println_stdout(&format!("{} manual pages: {}", pages.len(), out.display()));
    Ok(())
}

/// The pages of all commands, each with the name of its file.
fn pages() -> Result<Vec<(FileName, Vec<u8>)>, Stop> {
    let mut program = Program::command().disable_help_subcommand(true);
    // Gives every command its whole name.
    program.build();
    with_all_below(&program).into_iter().map(page).collect()
}

fn with_all_below(command: &Command) -> Vec<&Command> {
    let below = command.get_subcommands().flat_map(with_all_below);
    std::iter::once(command).chain(below).collect()
}

fn page(command: &Command) -> Result<(FileName, Vec<u8>), Stop> {
    let source = concat!("tracktwin ", env!("CARGO_PKG_VERSION"));
    // Without a date the source would be taken for it.
    let manual = Man::new(command.clone()).source(source).date(" ");
    let mut page = Vec::new();
    manual.render(&mut page)?;
    Ok((FileName::new(&manual.get_filename())?, page))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_has_the_whole_name_of_its_command_and_its_arguments() {
        let pages = pages().unwrap();
        let page = pages.iter().find(|(name, _)| name.as_str() == "tracktwin-library-copy.1");
        let page = String::from_utf8_lossy(&page.unwrap().1).into_owned();
        assert!(page.contains("tracktwin\\-library\\-copy"), "{page}");
        assert!(page.contains(r"\-\-from"), "{page}");
        assert!(!pages.iter().any(|(name, _)| name.as_str().contains("help")));
    }
}
