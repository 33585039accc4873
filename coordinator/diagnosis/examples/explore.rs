use nalgebra::{DMatrix, DVector};
use std::time::Instant;
use tracktwin_diagnosis::*;
use tracktwin_parameters::TrackDesign;
use tracktwin_signal::recording::Recording;
fn main() {
    let path = std::env::args().nth(1).unwrap();
    let recording = Recording::open(&path).unwrap();
    let t = Instant::now();
    let bands = Bands::new(80.0, 5100.0);
    let spectra = Spectra::new(&recording, &bands);
    eprintln!("spectra {:?} bands {}", t.elapsed(), bands.count());
    let first = recording.sleepers.iter().position(|s| s.id == "SN7").unwrap();
    let last = recording.sleepers.iter().position(|s| s.id == "SN31").unwrap();
    let section = Section {
        design: TrackDesign::v_track(),
        sleepers: last - first + 1,
        first_x_m: recording.sleepers[first].x_m,
    };
    let speeds: Vec<f64> = spectra.speeds.iter().map(|s| s.speed_km_h).collect();
    let noise: Vec<f64> = spectra.speeds.iter().map(|s| s.noise_density).collect();
    eprintln!("noise {noise:?}");
    let forward = Forward::new(section, bands, &speeds, noise);
    let nb = forward.bands.count();
    let mut l = DVector::zeros(forward.count());
    let mut pv = DVector::zeros(forward.per_sleeper());
    for (v, s) in spectra.speeds.iter().enumerate() {
        let n = s.passes.len() as f64;
        if let Some(var) = s.pass_variance() {
            for b in 0..nb {
                pv[v * nb + b] = var[b] / n;
            }
        }
        for j in 0..forward.section.sleepers {
            let m = s.mean(first + j).unwrap();
            for b in 0..nb {
                l[j * forward.per_sleeper() + v * nb + b] = m[b];
            }
        }
    }
    let t = Instant::now();
    let start = forward.unknowns.typical();
    let p = forward.log_power(&start, &[]).unwrap();
    eprintln!("fd {:?}", t.elapsed());
    let t = Instant::now();
    let _ = forward.linearised(&start, &[]).unwrap();
    eprintln!("lin {:?}", t.elapsed());
    let _ = p;
    // rough covariance
    let cov = DMatrix::from_fn(forward.per_sleeper(), forward.per_sleeper(), |i, j| {
        if i / nb == j / nb {
            let d = (i as f64 - j as f64) / 1.5;
            0.06 * (-0.5 * d * d).exp() + if i == j { 0.01 } else { 0.0 }
        } else {
            0.0
        }
    });
    let w = whitening(cov).unwrap();
    let obs = Observation { log_power: l.clone(), whitening: vec![w; forward.section.sleepers] };
    let t = Instant::now();
    let c = calibrate(&forward, &obs, &[], start).unwrap();
    eprintln!("cal {:?} obj {}", t.elapsed(), c.objective);
    let name = "/tmp/diag/".to_string() + &recording.name;
    std::fs::create_dir_all("/tmp/diag").unwrap();
    let nullfile = format!(
        "{}.null.json",
        std::env::args().nth(2).map(|n| format!("/tmp/diag/{n}")).unwrap_or(name.clone())
    );
    let null: NullModel = match std::fs::read(&nullfile) {
        Ok(b) => serde_json::from_slice(&b).unwrap(),
        Err(_) => {
            let t = Instant::now();
            let n = NullModel::simulate(&forward, &c.values, 32, 1000, |_| ()).unwrap();
            eprintln!("null {:?}", t.elapsed());
            std::fs::write(&nullfile, serde_json::to_vec(&n).unwrap()).unwrap();
            n
        }
    };
    let off = null.offset();
    let cov = null.covariance(nb, &pv);
    let sd = cov.diagonal().map(f64::sqrt);
    let w = whitening(cov).unwrap();
    let mut lo = l.clone();
    for j in 0..forward.section.sleepers {
        for i in 0..forward.per_sleeper() {
            lo[j * forward.per_sleeper() + i] -= off[i];
        }
    }
    let obs = Observation { log_power: lo.clone(), whitening: vec![w; forward.section.sleepers] };
    let t = Instant::now();
    let c = calibrate(&forward, &obs, &[], c.values).unwrap();
    eprintln!(
        "cal2 {:?} obj {} chi2/n {}",
        t.elapsed(),
        c.objective,
        c.residual.norm_squared() / c.residual.len() as f64
    );
    let fit = forward.log_power(&c.values, &[]).unwrap();
    let out = serde_json::json!({"bands": forward.bands.centres_hz(), "speeds": speeds, "offset": off.as_slice(), "sd": sd.as_slice(), "pv": pv.as_slice(),
      "residual": (lo - fit).as_slice(), "whitened": c.residual.as_slice(), "values": c.values.as_slice(), "sleepers": forward.section.sleepers, "first": recording.sleepers[first].id});
    std::fs::write(format!("{name}.json"), serde_json::to_vec(&out).unwrap()).unwrap();
}
