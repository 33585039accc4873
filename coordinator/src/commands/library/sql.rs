//! `tracktwin library sql`: queries a library with SQL.

use super::files::text;
use super::{OrInput, Stop};
use crate::commands::library_url::LibraryUrl;
use anyhow::{Context, anyhow};
use clap::{Args, ValueEnum};
use std::io::{self, BufWriter, StdoutLock, Write};
use tracktwin_library::{Answer, Cell, LibraryError};

/// Significant digits of a number in a table.
const DIGITS: usize = 9;

/// Arguments of `library sql`.
#[derive(Args)]
#[command(
    after_help = "Tables and views, with worked queries: docs/how-to/query-the-library.md.\n\
    Names with capital letters need no quotes, with SQLite and PostgreSQL.\n\n\
    Example:\n  tracktwin library sql --library sqlite:out/library.sqlite \\\n      \
    \"select name, finished, cases from campaign_status\""
)]
pub(in crate::commands) struct Arguments {
    /// SQL statement; `-` reads it from standard input.
    #[arg(allow_hyphen_values = true)]
    statement: String,
    #[command(flatten)]
    library: LibraryUrl,
    /// Output format.
    #[arg(long, value_enum, default_value_t = Format::Table)]
    format: Format,
}

#[derive(Clone, Copy, ValueEnum)]
enum Format {
    /// Aligned columns; numbers with nine digits.
    Table,
    /// Comma-separated values with column names; numbers with all digits.
    Csv,
    /// Array with one object per row; numbers with all digits.
    Json,
}

pub(super) async fn run(arguments: &Arguments) -> Result<(), Stop> {
    let library = arguments.library.open_to_read().await?;
    let mut printer = Printer {
        out: BufWriter::new(io::stdout().lock()),
        format: arguments.format,
        names: Vec::new(),
        rows: Vec::new(),
        printed: 0,
    };
    let statement = match arguments.statement.as_str() {
        "-" => io::read_to_string(io::stdin()).context("standard input").or_input()?,
        given => given.to_owned(),
    };
    let answered = library.query(&statement, &mut printer).await;
    match answered.and_then(|()| printer.end()) {
        Ok(()) => Ok(()),
        // The reader has closed the output, as `head` does.
        Err(Ended::Output(error)) if error.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        Err(Ended::Output(error)) => Err(error.into()),
        Err(Ended::Library(error)) => Err(error.into()),
        Err(Ended::Twice(column)) => {
            Err(anyhow!("two columns are named {column}; rename one with `as` for JSON output"))
                .or_input()
        }
    }
}

/// Reason for an early end of the output.
enum Ended {
    Library(LibraryError),
    Output(io::Error),
    /// Two columns have this name, but a name can occur only once in a JSON object.
    Twice(String),
}

impl From<LibraryError> for Ended {
    fn from(error: LibraryError) -> Self {
        Self::Library(error)
    }
}

impl From<io::Error> for Ended {
    fn from(error: io::Error) -> Self {
        Self::Output(error)
    }
}

struct Printer {
    out: BufWriter<StdoutLock<'static>>,
    format: Format,
    names: Vec<String>,
    /// All rows, for a table, because its columns are as wide as their widest cell.
    rows: Vec<Vec<String>>,
    printed: usize,
}

impl Answer for Printer {
    type Error = Ended;

    fn columns(&mut self, names: &[String]) -> Result<(), Ended> {
        self.names = names.to_vec();
        match self.format {
            Format::Table => self.rows.push(self.names.clone()),
            Format::Csv => csv_record(&mut self.out, names)?,
            Format::Json => {
                if let Some(twice) =
                    names.iter().find(|it| names.iter().filter(|n| n == it).count() > 1)
                {
                    return Err(Ended::Twice(twice.clone()));
                }
                write!(self.out, "[")?;
            }
        }
        Ok(())
    }

    fn row(&mut self, cells: Vec<Cell>) -> Result<(), Ended> {
        match self.format {
            Format::Table => {
                self.rows.push(cells.iter().map(|cell| text::cell(&legible(cell))).collect());
            }
            Format::Csv => {
                let cells: Vec<_> = cells.iter().map(text::cell).collect();
                csv_record(&mut self.out, &cells)?;
            }
            Format::Json => {
                let before = if self.printed == 0 { "\n" } else { ",\n" };
                let names = self.names.iter().map(String::as_str).map(serde_json::Value::from);
                let pairs = names.zip(cells.into_iter().map(text::json));
                let pairs: Vec<_> = pairs.map(|(name, cell)| format!("{name}:{cell}")).collect();
                write!(self.out, "{before}  {{{}}}", pairs.join(","))?;
            }
        }
        self.printed += 1;
        Ok(())
    }
}

fn csv_record(out: &mut impl Write, cells: &[String]) -> io::Result<()> {
    // Rows are written at once: `out` is buffered.
    let mut writer = csv::WriterBuilder::new().buffer_capacity(256).from_writer(out);
    writer.write_record(cells)?;
    writer.flush()
}

/// A number rounded to the digits of a table.
fn legible(cell: &Cell) -> Cell {
    match cell {
        Cell::Real(real) => {
            let rounded = format!("{real:.*e}", DIGITS - 1).parse();
            Cell::Real(rounded.expect("it was a number"))
        }
        other => other.clone(),
    }
}

impl Printer {
    fn end(&mut self) -> Result<(), Ended> {
        match self.format {
            Format::Table => text::table(&self.rows, &mut self.out)?,
            Format::Csv => {}
            Format::Json => writeln!(self.out, "{}]", if self.printed == 0 { "" } else { "\n" })?,
        }
        Ok(self.out.flush()?)
    }
}
