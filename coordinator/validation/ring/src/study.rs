//! The study of a ring: its truth, the estimates, and all statements about them.

use crate::diagnosed::Diagnoses;
use crate::statement::Statement;
use crate::{Estimated, Plan, RailSpectra, Ring, Truth};
use crate::{
    compared, diagnosed, methods, pictures, repeated, spectra, structures, surface_statements,
};
use serde::Serialize;
use tracktwin_reproduction::{ClaimVerdict, Picture};

/// The format of `ring.json`.
const FORMAT: &str = "tracktwin-ring/1";

/// Source of estimates.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Method {
    /// Fit of the track model to all passes.
    Inversion,
    /// The same fit with the physics that the diagnosis of the first lap accepted.
    InversionWithDiagnosis,
    /// Gaussian processes of a library.
    GaussianProcesses,
    /// Model selector of the same library.
    Selector,
    /// Diagnosis of each lap.
    Diagnosis,
    /// The recording itself.
    Recording,
}

impl Method {
    /// Name of the method in data files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Inversion => "inversion",
            Self::InversionWithDiagnosis => "inversion_with_diagnosis",
            Self::GaussianProcesses => "gp",
            Self::Selector => "selector",
            Self::Diagnosis => "diagnosis",
            Self::Recording => "recording",
        }
    }

    /// Name of the method for readers.
    pub const fn label(self) -> &'static str {
        match self {
            Self::Inversion => "inversion",
            Self::InversionWithDiagnosis => "inversion with diagnosis",
            Self::GaussianProcesses => "Gaussian processes",
            Self::Selector => "model selector",
            Self::Diagnosis => "diagnosis",
            Self::Recording => "recording",
        }
    }
}

/// A ring with all estimates and diagnoses.
#[derive(Clone, Debug)]
pub struct Study {
    /// The plan.
    pub plan: Plan,
    /// The truth.
    pub truth: Truth,
    /// Estimates from all passes, by method.
    pub methods: Vec<(Method, Estimated)>,
    /// Estimates of the inversion from each lap.
    pub laps: Vec<Estimated>,
    /// Estimates of the inversion from the passes of each speed in km/h.
    pub speeds: Vec<(f64, Estimated)>,
    /// Spectra of the rails at the highest speed.
    pub spectra: Option<RailSpectra>,
    /// Diagnoses of all laps.
    pub diagnoses: Diagnoses,
}

/// The content of `ring.json`.
#[derive(Serialize)]
struct Document<'a> {
    format: &'static str,
    code_version: &'static str,
    plan: &'a Plan,
    statements: Vec<Statement>,
    diagnoses: &'a Diagnoses,
}

impl Study {
    /// A study without estimates.
    pub fn new(ring: &Ring) -> Self {
        Self {
            plan: ring.plan().clone(),
            truth: ring.truth(),
            methods: Vec::new(),
            laps: Vec::new(),
            speeds: Vec::new(),
            spectra: None,
            diagnoses: Diagnoses::default(),
        }
    }

    /// Estimates of a method from all passes.
    pub(crate) fn by(&self, method: Method) -> Option<&Estimated> {
        self.methods.iter().find(|(of, _)| *of == method).map(|(_, estimated)| estimated)
    }

    /// All statements, in the order of the paper.
    pub fn statements(&self) -> Vec<Statement> {
        let mut all = Vec::new();
        for (method, estimated) in &self.methods {
            if *method != Method::InversionWithDiagnosis {
                all.extend(surface_statements::statements(self, *method, estimated));
            }
            all.extend(structures::statements(self, *method, estimated));
            all.extend(compared::statements(self, *method, estimated));
        }
        all.extend(methods::statements(self));
        all.extend(spectra::statements(self));
        all.extend(repeated::statements(self));
        all.extend(diagnosed::statements(self));
        all
    }

    /// Pictures like the paper's Figs. 20, 21, 22 and 24, each group with its caption.
    pub fn pictures(&self) -> Vec<(Vec<Picture>, &'static str)> {
        pictures::pictures(self)
    }

    /// Number of statements with this verdict.
    pub fn count(statements: &[Statement], verdict: ClaimVerdict) -> usize {
        statements.iter().filter(|statement| statement.verdict == verdict).count()
    }

    /// The text of `ring.json`.
    pub fn to_json(&self) -> String {
        let document = Document {
            format: FORMAT,
            code_version: env!("CARGO_PKG_VERSION"),
            plan: &self.plan,
            statements: self.statements(),
            diagnoses: &self.diagnoses,
        };
        let text = serde_json::to_string_pretty(&document);
        format!("{}\n", text.expect("texts and numbers are JSON"))
    }
}
