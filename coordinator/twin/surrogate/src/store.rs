//! Trained models, and the folder in which they are stored.
//!
//! `models.json` contains everything except the large tables: format, campaign, digest of the
//! library, feature definition, hyper-parameters, scores. Beside it is one safetensors file per
//! group, with float64 tables, that any program can read. A prediction in Python:
//!
//! ```python
//! import json, numpy as np
//! from safetensors.numpy import load_file
//! group = json.load(open("models.json"))["groups"][0]
//! t = load_file(group["file"])
//! model, j = group["models"][2], 2
//! z = (x - t["offset"]) @ t["projection"]     # x: ln-powers of the group's columns, speeds side by side
//! r = np.linalg.norm(t["inputs"] - z, axis=1)
//! k = np.exp(-r / model["hyperparameters"]["length"])
//! h = np.r_[1.0, z] if group["mean"] == "linear" else np.ones(1)
//! unit = h @ t["coefficients"][:, j] + k @ t["weights"][:, j]
//! low, high = model["range"]
//! value = low + np.clip(unit, 0, 1) * (high - low)  # `scale` is "linear"; else low * (high / low) ** clipped
//! ```

use crate::group::different;
use crate::{
    Error, GroupKey, InputMap, InputScaling, MeanFunction, ModelGroup, ParameterModel, TrainingSet,
};
use faer::{Mat, MatRef};
use safetensors::tensor::{Dtype, SafeTensors, TensorView};
use serde::{Deserialize, Serialize};
use std::path::Path;
use std::sync::OnceLock;
use tracktwin_files::{FileName, Kind, Names, Output, inside};

/// Value of the field `format` in `models.json`.
pub const FORMAT: &str = "tracktwin-models/1";
/// File of a folder of models that names the others.
pub const INDEX: &str = "models.json";

/// All models of a library.
pub struct Trained {
    about: About,
    groups: Vec<ModelGroup>,
}

/// Data common to all groups.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct About {
    format: String,
    code_version: String,
    campaign: String,
    library_digest: String,
    feature_definition: serde_json::Value,
    #[serde(rename = "frequencies_Hz")]
    frequencies_hz: Vec<f64>,
    speeds_km_h: Vec<f64>,
    entries: usize,
    split_seed: u64,
}

#[derive(Serialize, Deserialize)]
struct Index {
    #[serde(flatten)]
    about: About,
    groups: Vec<GroupRow>,
}

/// A group in the index: all but its tables.
#[derive(Serialize, Deserialize)]
struct GroupRow {
    #[serde(flatten)]
    key: GroupKey,
    file: String,
    blake3: String,
    scaling: InputScaling,
    mean: MeanFunction,
    models: Vec<ParameterModel>,
}

impl Trained {
    pub(crate) fn new(set: &TrainingSet, split_seed: u64, groups: Vec<ModelGroup>) -> Self {
        let about = About {
            format: FORMAT.to_owned(),
            code_version: env!("CARGO_PKG_VERSION").to_owned(),
            campaign: set.campaign.clone(),
            library_digest: set.library_digest.clone(),
            feature_definition: set.feature_definition.clone(),
            frequencies_hz: set.frequencies_hz.clone(),
            speeds_km_h: set.speeds_km_h.clone(),
            entries: set.entries(),
            split_seed,
        };
        Self { about, groups }
    }

    /// Name of the campaign the models were trained on.
    pub fn campaign(&self) -> &str {
        &self.about.campaign
    }

    /// Digest of the library the models were trained on.
    pub fn library_digest(&self) -> &str {
        &self.about.library_digest
    }

    /// Definition of the features in training; a recording must be evaluated with the same definition.
    pub fn feature_definition(&self) -> &serde_json::Value {
        &self.about.feature_definition
    }

    /// Frequencies of the bins in Hz.
    pub fn frequencies_hz(&self) -> &[f64] {
        &self.about.frequencies_hz
    }

    /// Speeds of the library in km/h.
    pub fn speeds_km_h(&self) -> &[f64] {
        &self.about.speeds_km_h
    }

    /// Number of entries of the library, including the test half.
    pub fn entries(&self) -> usize {
        self.about.entries
    }

    /// Random seed that selects, with [`Self::entries`], the training half ([`crate::Split::halves`]).
    pub fn split_seed(&self) -> u64 {
        self.about.split_seed
    }

    /// All groups: every feature set at every speed, then all speeds together.
    pub fn groups(&self) -> &[ModelGroup] {
        &self.groups
    }

    /// The group for `feature` at exactly these speeds in km/h, or `None` if it was not trained.
    pub fn group(&self, speeds_km_h: &[f64], feature: &str) -> Option<&ModelGroup> {
        self.groups
            .iter()
            .find(|group| group.key.feature == feature && group.key.speeds_km_h == speeds_km_h)
    }

    /// Checks that the models were trained on the library with this digest.
    ///
    /// # Errors
    /// [`Error::OtherLibrary`] with both digests.
    pub fn belongs_to(&self, library_digest: &str) -> Result<(), Error> {
        if self.about.library_digest == library_digest {
            return Ok(());
        }
        Err(Error::OtherLibrary {
            trained_on: self.about.library_digest.clone(),
            offered: library_digest.to_owned(),
        })
    }

    /// Writes the models into `folder` and creates the folder if necessary. Either all files are written or
    /// none.
    ///
    /// # Errors
    /// [`Error::Files`] with the file that cannot be written or already exists.
    pub fn save(&self, folder: &Path) -> Result<(), Error> {
        let mut output = Output::begin(folder, Kind::Models, false).map_err(Error::Files)?;
        self.add_to(&mut output)?;
        output.commit().map_err(Error::Files)
    }

    /// Adds the models to the files of an output folder. The manifest names all files and is replaced last;
    /// until then no file replaces another. The folder therefore holds either the old models or the new
    /// ones.
    ///
    /// # Errors
    /// [`Error::Files`] with the file that cannot be written.
    pub fn add_to(&self, output: &mut Output) -> Result<(), Error> {
        let mut names = Names::default();
        let rows = self.groups.iter().map(|group| add_group(group, &mut names, output));
        let groups = rows.collect::<Result<_, _>>()?;
        let index = Index { about: self.about.clone(), groups };
        let text = serde_json::to_vec_pretty(&index).expect("an index of numbers and names");
        let name = FileName::new(INDEX).map_err(Error::Files)?;
        output.add_manifest(&name, &text).map_err(Error::Files)
    }

    /// Reads models from `folder`.
    ///
    /// # Errors
    /// [`Error::Files`] or [`Error::File`] if a file cannot be read, [`Error::Malformed`] if it has another
    /// format, [`Error::Changed`] if it differs from the file that was saved. Each error names the file.
    pub fn load(folder: &Path) -> Result<Self, Error> {
        let path = folder.join(INDEX);
        let malformed = |reason: String| Error::Malformed { path: path.clone(), reason };
        let json: serde_json::Value =
            serde_json::from_slice(&tracktwin_files::read(&path).map_err(Error::Files)?)
                .map_err(|error| malformed(error.to_string()))?;
        match json.get("format").and_then(serde_json::Value::as_str) {
            Some(FORMAT) => {}
            Some(other) => {
                return Err(malformed(format!(
                    "the format is {other}; this program reads {FORMAT}"
                )));
            }
            None => {
                return Err(malformed(format!(
                    "the format is missing; this program reads {FORMAT}"
                )));
            }
        }
        let index: Index =
            serde_json::from_value(json).map_err(|error| malformed(error.to_string()))?;
        let bins = index.about.frequencies_hz.len();
        let groups = index
            .groups
            .into_iter()
            .map(|row| load_group(row, bins, folder))
            .collect::<Result<_, _>>()?;
        Ok(Self { about: index.about, groups })
    }
}

fn add_group(
    group: &ModelGroup,
    names: &mut Names,
    output: &mut Output,
) -> Result<GroupRow, Error> {
    let speeds: Vec<String> = group.key.speeds_km_h.iter().map(ToString::to_string).collect();
    let file = names.make(&format!("{}_{}", group.key.feature, speeds.join("_")));
    let file = file.with_ending("safetensors");
    let offset =
        MatRef::from_row_major_slice(&group.input_map.offset, 1, group.input_map.offset.len());
    let tables = [
        ("offset", offset),
        ("projection", group.input_map.projection.as_ref()),
        ("inputs", group.inputs.as_ref()),
        ("weights", group.weights.as_ref()),
        ("coefficients", group.coefficients.as_ref()),
    ]
    .map(|(name, table)| (name, [table.nrows(), table.ncols()], little_endian(table)));
    let views = tables.iter().map(|(name, shape, bytes)| {
        let view = TensorView::new(Dtype::F64, shape.to_vec(), bytes);
        (*name, view.expect("eight bytes a number"))
    });
    let serialized = safetensors::serialize(views, None);
    let bytes = serialized.map_err(|error| malformed(Path::new(file.as_str()), &error))?;
    output.add(&file, &bytes).map_err(Error::Files)?;
    let file = output.unique_name(&file).map_err(Error::Files)?.to_string();
    Ok(GroupRow {
        key: group.key.clone(),
        file,
        blake3: blake3::hash(&bytes).to_hex().to_string(),
        scaling: group.input_map.scaling,
        mean: group.mean,
        models: group.models.clone(),
    })
}

fn load_group(row: GroupRow, bins: usize, folder: &Path) -> Result<ModelGroup, Error> {
    let path = inside(folder, &row.file).map_err(Error::Files)?;
    let bytes = read(&path)?;
    if blake3::hash(&bytes).to_hex().as_str() != row.blake3 {
        return Err(Error::Changed { path });
    }
    let tensors = SafeTensors::deserialize(&bytes).map_err(|error| malformed(&path, &error))?;
    let table = |name: &str| table(&tensors, name).map_err(|reason| malformed(&path, &reason));
    let offset = table("offset")?.row(0).iter().copied().collect();
    let at: Vec<_> = row.models.iter().map(|model| model.hyperparameters).collect();
    Ok(ModelGroup {
        key: row.key,
        bins,
        input_map: InputMap { scaling: row.scaling, offset, projection: table("projection")? },
        mean: row.mean,
        inputs: table("inputs")?,
        weights: table("weights")?,
        coefficients: table("coefficients")?,
        models: row.models,
        factors: different(&at).into_iter().map(|at| (at, OnceLock::new())).collect(),
    })
}

/// Numbers in row-major order, eight little-endian bytes each.
fn little_endian(table: MatRef<'_, f64>) -> Vec<u8> {
    table
        .row_iter()
        .flat_map(|row| row.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<_>>())
        .collect()
}

fn table(tensors: &SafeTensors<'_>, name: &str) -> Result<Mat<f64>, String> {
    let view = tensors.tensor(name).map_err(|error| error.to_string())?;
    let (Dtype::F64, &[rows, columns]) = (view.dtype(), view.shape()) else {
        return Err(format!("{name} is not a table of float64"));
    };
    let (numbers, _) = view.data().as_chunks::<8>();
    Ok(Mat::from_fn(rows, columns, |i, j| f64::from_le_bytes(numbers[i * columns + j])))
}

fn read(path: &Path) -> Result<Vec<u8>, Error> {
    std::fs::read(path).map_err(|source| Error::File { path: path.to_owned(), source })
}

fn malformed(path: &Path, reason: &dyn std::fmt::Display) -> Error {
    Error::Malformed { path: path.to_owned(), reason: reason.to_string() }
}
