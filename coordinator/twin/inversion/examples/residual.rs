use tracktwin_diagnosis::*;
use tracktwin_signal::recording::Recording;
fn main() {
    let path = std::env::args().nth(1).unwrap();
    let recording = Recording::open(std::path::Path::new(&path)).unwrap();
    let track = recording.stated_track().track;
    let mut prepared = PreparedRecording::sections(&recording, &track, 24, 8).unwrap().remove(0);
    let values = first_calibration(&prepared).unwrap();
    prepared.forward.allow_beyond(&values).unwrap();
    let f = &prepared.forward;
    let grid = NullModel::grid_values(f, &values);
    let null = NullModel::simulate(f, &grid, 40, 1, &|_| ()).unwrap();
    let fitted = tracktwin_inversion::fit(&prepared, &null, values).unwrap();
    let predicted = f.log_power(&fitted.values, &[]).unwrap();
    let measured = prepared.expected_log_power(&null);
    let raw = &prepared.log_power;
    let cov = prepared.covariance(&null);
    let nb = f.bands.count();
    println!("offset by null, mean residual, rms residual (nats), sd; level dB; noise dB");
    for b in 0..nb {
        print!("{:7.0}", f.bands.centres_hz()[b]);
        for s in 0..f.speeds_m_s.len() {
            let rows: Vec<f64> = (0..f.section.sleepers).map(|i| { let r=i*f.per_sleeper()+s*nb+b; measured[r]-predicted[r]}).collect();
            let mean = rows.iter().sum::<f64>()/rows.len() as f64;
            let rms = (rows.iter().map(|x|(x-mean)*(x-mean)).sum::<f64>()/rows.len() as f64).sqrt();
            let r0 = s*nb+b;
            let lvl = (0..f.section.sleepers).map(|i| raw[i*f.per_sleeper()+r0]).sum::<f64>()/f.section.sleepers as f64*4.343;
            let bw: f64 = f.bands.weights(b).iter().map(|w| w.1).sum();
            let noise = (bw*f.noise_density[s]).ln()*4.343;
            let wl = f.speeds_m_s[s]/f.bands.centres_hz()[b];
            print!(" | {:6.2} {:6.2} {:5.2} ({:4.2}) {:6.1} {:6.1} {:5.1}mm", raw[r0]-measured[r0], mean, rms, cov[(r0,r0)].sqrt(), lvl, noise, wl*1e3);
        }
        println!();
    }
    let u=&f.unknowns;
    println!("spectrum {:?}", u.spectrum().map(|i| (fitted.values[i]*100.0).round()/100.0).collect::<Vec<_>>());
    println!("gains {:?}", u.gains().map(|i| (fitted.values[i]*100.0).round()/100.0).collect::<Vec<_>>());
    println!("response {:?}", u.response().map(|i| (fitted.values[i]*100.0).round()/100.0).collect::<Vec<_>>());
}
