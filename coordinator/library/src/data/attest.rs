//! Comparison of results with their checksums while a table is read.

use super::{Cell, Table};
use crate::LibraryError;
use crate::result::LEVEL_COLUMNS;
use tracktwin_experiment::PassFeatures;
use tracktwin_protocol::checksum_of_passes;
use tracktwin_signal::Features;

/// Checks the checksum of each case. It does nothing for tables without a column `checksum`.
pub(super) struct Attestation<'a> {
    table: &'a Table,
    present: Option<Present>,
}

/// The passes read so far of one case.
struct Present {
    campaign: String,
    index: u32,
    parameter_hash: String,
    passes: Vec<PassFeatures>,
    checksum: Option<String>,
}

impl<'a> Attestation<'a> {
    pub(super) const fn of(table: &'a Table) -> Self {
        Self { table, present: None }
    }

    /// Adds rows, which must be in the order of campaign, index and speed.
    ///
    /// # Errors
    /// Returns [`LibraryError::Altered`] if a completed case does not match its checksum.
    pub(super) fn take(&mut self, rows: &[Vec<Cell>]) -> Result<(), LibraryError> {
        if self.table.column("checksum").is_none() {
            return Ok(());
        }
        for row in rows {
            let Some(mut next) = self.first_pass(row) else { continue };
            match &mut self.present {
                Some(present) if present.is_of(&next) => present.passes.append(&mut next.passes),
                before => before.replace(next).map_or(Ok(()), Present::check)?,
            }
        }
        Ok(())
    }

    /// Checks the last case.
    ///
    /// # Errors
    /// As [`Attestation::take`].
    pub(super) fn end(self) -> Result<(), LibraryError> {
        self.present.map_or(Ok(()), Present::check)
    }

    /// Converts a row to a case with one pass; `None` if a cell is missing, which the schema does not
    /// allow.
    fn first_pass(&self, row: &[Cell]) -> Option<Present> {
        let cell = |column: &str| row.get(self.table.column(column)?);
        let text = |column| match cell(column) {
            Some(Cell::Text(text)) => Some(text.clone()),
            _ => None,
        };
        let real = |column: &str| match cell(column) {
            Some(Cell::Real(real)) => Some(*real),
            _ => None,
        };
        let Some(Cell::Doubles(log_power)) = cell("log_power") else { return None };
        let Some(Cell::Integer(index)) = cell("sobol_index") else { return None };
        let band_levels_db =
            LEVEL_COLUMNS.iter().map(|column| real(column)).collect::<Option<_>>()?;
        let pass = PassFeatures {
            speed_km_h: real("speed_km_h")?,
            features: Features { log_power: log_power.clone(), band_levels_db },
            contact_loss_share: real("contact_loss_share"),
        };
        Some(Present {
            campaign: text("campaign_id")?,
            index: u32::try_from(*index).ok()?,
            parameter_hash: text("parameter_hash")?,
            passes: vec![pass],
            checksum: text("checksum"),
        })
    }
}

impl Present {
    fn is_of(&self, other: &Self) -> bool {
        (self.index, &self.campaign) == (other.index, &other.campaign)
    }

    fn check(self) -> Result<(), LibraryError> {
        let Self { index, parameter_hash, passes, checksum, .. } = self;
        match checksum {
            Some(told) if told != checksum_of_passes(index, &parameter_hash, &passes) => {
                Err(LibraryError::Altered { index })
            }
            _ => Ok(()),
        }
    }
}
