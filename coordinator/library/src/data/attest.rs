//! Holding rows of results against their checksums while they are read out.

use super::{Cell, Table};
use crate::LibraryError;
use crate::result::LEVEL_COLUMNS;
use tracktwin_experiment::PassFeatures;
use tracktwin_protocol::checksum_of_passes;
use tracktwin_signal::Features;

/// The case whose rows are coming; looks at nothing where the table's rows have no checksum.
pub(super) struct Attestation<'a> {
    table: &'a Table,
    present: Option<Present>,
}

/// Passes of one case, so far.
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

    /// Takes rows, which come by campaign, index and speed.
    ///
    /// # Errors
    /// [`LibraryError::Altered`] where the case before does not have its checksum.
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

    /// Looks at the last case.
    ///
    /// # Errors
    /// As [`Attestation::take`].
    pub(super) fn end(self) -> Result<(), LibraryError> {
        self.present.map_or(Ok(()), Present::check)
    }

    /// A row as a case of one pass; none where a cell is missing, which the schema does not allow.
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
