//! Unsupported file formats of loggers and programs, with the remedy.

use super::super::error::Fault;

/// A kind of file: how it begins, how its name ends, what it is and how it becomes a table.
struct Kind {
    begins: &'static [&'static [u8]],
    endings: &'static [&'static str],
    name: &'static str,
    remedy: &'static str,
}

const KINDS: [Kind; 15] = [
    Kind {
        begins: &[b"MATLAB 7.3"],
        endings: &[],
        name: "a MATLAB file of version 7.3 (HDF5)",
        remedy: "save it again in MATLAB with `save(file, names, '-v7')`, or read it with Python's h5py",
    },
    Kind {
        begins: &[b"\x89HDF\r\n"],
        endings: &["h5", "hdf5", "hdf", "nc"],
        name: "an HDF5 file",
        remedy: "read its data sets with Python's h5py and save them with `numpy.savez`",
    },
    Kind {
        begins: &[b"|CF,"],
        endings: &["raw"],
        name: "a file of imc FAMOS or imc STUDIO",
        remedy: "export it there as CSV, or convert it with IMCtermite",
    },
    Kind {
        begins: &[b"    -1\n", b"    -1\r\n", b"    -1  "],
        endings: &["uff", "unv", "uf", "bunv"],
        name: "a universal file (UFF)",
        remedy: "read it with Python's pyuff and save its data with `numpy.savez`",
    },
    Kind {
        // The number of a catman file's version, 5011 to 5013.
        begins: &[b"\x93\x13", b"\x94\x13", b"\x95\x13"],
        endings: &["bin"],
        name: "a catman file of HBM",
        remedy: "export it in catman as ASCII or MATLAB, or convert it with Python's apread",
    },
    Kind {
        begins: &[b"TDSm"],
        endings: &["tdms"],
        name: "a TDMS file of LabVIEW or DIAdem",
        remedy: "convert it with Python's npTDMS: `TdmsFile.read(file).as_dataframe().to_parquet(...)`",
    },
    Kind {
        begins: &[b"MDF ", b"UnFinMF "],
        endings: &["mf4", "mdf"],
        name: "an MDF file",
        remedy: "convert it with Python's asammdf: `MDF(file).to_dataframe().to_parquet(...)`",
    },
    Kind {
        begins: &[],
        endings: &["xlsx", "xls", "ods"],
        name: "a spreadsheet",
        remedy: "save its sheet as CSV",
    },
    Kind {
        begins: &[b"RIFF", b"RF64"],
        endings: &["wav"],
        name: "a WAV file",
        remedy: "read it with Python's scipy.io.wavfile and save it with `numpy.save`; use --unit \
             unknown",
    },
    Kind {
        begins: &[b"ARROW1", b"FEA1"],
        endings: &["feather", "arrow"],
        name: "a Feather or Arrow file",
        remedy: "convert it with pandas: `read_feather(file).to_parquet(...)`",
    },
    Kind {
        begins: &[],
        endings: &["pkl", "pickle", "rds", "rda", "rdata"],
        name: "a file of Python or R objects",
        remedy: "save its table as CSV or Parquet",
    },
    Kind {
        begins: &[],
        endings: &["dxd", "d7d", "dat3", "lvm", "tdm", "sie", "rsp", "asc3"],
        name: "a proprietary file of a measuring program",
        remedy: "export it there as CSV or MATLAB (v7)",
    },
    Kind {
        begins: &[b"\x1f\x8b"],
        endings: &["gz"],
        name: "a file compressed with gzip",
        remedy: "unpack it first: `gunzip FILE`",
    },
    Kind {
        begins: &[b"BZh", b"\xfd7zXZ\0", b"\x28\xb5\x2f\xfd", b"7z\xbc\xaf\x27\x1c"],
        endings: &["bz2", "xz", "zst", "7z"],
        name: "a compressed file",
        remedy: "unpack it first",
    },
    Kind {
        begins: &[b"PK\x03\x04", b"\xd0\xcf\x11\xe0"],
        endings: &["zip"],
        name: "an archive or a spreadsheet",
        remedy: "unpack it, or save its sheet as CSV",
    },
];

/// The fault of a file of an unsupported format, from its first bytes or otherwise from the `ending` of
/// its name.
///
/// `holds_zip` for kinds of files that are archives themselves and are read.
pub(super) fn fault(begin: &[u8], ending: &str, holds_zip: bool) -> Option<Fault> {
    let begins = |kind: &&Kind| kind.begins.iter().any(|bytes| begin.starts_with(bytes));
    let ends = |kind: &&Kind| kind.endings.contains(&ending);
    let by_content = KINDS.iter().find(begins).filter(|_| !holds_zip);
    let by_name = KINDS.iter().find(ends);
    // A spreadsheet starts like an archive; its extension distinguishes it.
    let found = match (by_content, by_name) {
        (Some(content), Some(name)) if content.begins.contains(&&b"PK\x03\x04"[..]) => Some(name),
        (content, name) => content.or(name),
    };
    found.map(|kind| Fault::Foreign { kind: kind.name, remedy: kind.remedy })
}
