//! A part of the signal with its CWT and SSWT maps (paper, Fig. 2).

use base64::Engine as _;
use base64::prelude::BASE64_STANDARD;
use std::ops::Range;
use tracktwin_drawing::{Axis, Chart};
use tracktwin_number::rounded;
use tracktwin_signal::recording::Recording;
use tracktwin_signal::{Extractor, TimeFrequencyMap};

const SIZE: [f64; 2] = [1130.0, 300.0];
const COLUMNS: usize = 900;
/// Range of the colour scale below the maximum, in dB.
const DEPTH_DB: f64 = 50.0;
/// Half length of the part, in sleeper spacings.
const SPACINGS: f64 = 2.5;
/// Number of columns of the drawn signal; each has the lowest and the highest value.
const SIGNAL_COLUMNS: usize = 1000;

/// Charts of signal, CWT and SSWT over five spans around `x_m` in one pass, which must cover `x_m`. A map
/// that cannot be computed is left out.
pub(crate) fn map_charts(
    recording: &Recording,
    extractor: &Extractor,
    pass: usize,
    x_m: f64,
) -> Vec<String> {
    let stretch = Stretch::around(recording, pass, x_m);
    let signal = &recording.passes[pass].signal;
    let maps = [
        ("CWT power", extractor.cwt_map(signal, stretch.samples.clone(), COLUMNS)),
        ("SSWT power", extractor.sswt_map(signal, stretch.samples.clone(), COLUMNS)),
    ];
    let mut charts = vec![stretch.signal_chart()];
    charts.extend(
        maps.into_iter().filter_map(|(title, map)| Some(stretch.map_chart(title, &map.ok()?))),
    );
    charts
}

/// The samples to draw, with their positions.
struct Stretch<'a> {
    recording: &'a Recording,
    pass: usize,
    samples: Range<usize>,
}

impl<'a> Stretch<'a> {
    fn around(recording: &'a Recording, pass: usize, x_m: f64) -> Self {
        let positions = &recording.passes[pass].position_m;
        let half = SPACINGS * recording.spacing_m;
        let start = positions.partition_point(|&position| position < x_m - half);
        let end = positions.partition_point(|&position| position <= x_m + half);
        Self { recording, pass, samples: start..end.max(start + 1).min(positions.len()) }
    }

    fn positions(&self) -> &[f64] {
        &self.recording.passes[self.pass].position_m[self.samples.clone()]
    }

    fn chart(&self, title: &str, height: f64, y: Axis) -> Chart {
        let positions = self.positions();
        let x = Axis::linear("position in m", positions[0], positions[positions.len() - 1]);
        let pass = &self.recording.passes[self.pass];
        let title = format!("{title}, {} km/h ({})", rounded(pass.speed_km_h, 4), pass.file);
        Chart::new(&title, [SIZE[0], height], x, y)
    }

    fn mark_sleepers(&self, chart: &mut Chart) {
        let positions = self.positions();
        let inside = positions[0]..=positions[positions.len() - 1];
        for sleeper in self.recording.sleepers.iter().filter(|s| inside.contains(&s.x_m)) {
            chart.vertical(sleeper.x_m);
        }
    }

    fn signal_chart(&self) -> String {
        let samples = &self.recording.passes[self.pass].signal.samples()[self.samples.clone()];
        let y = Axis::around("acceleration in m/s²", samples.iter().copied());
        let mut chart = self.chart("Axle-box acceleration", 220.0, y);
        self.mark_sleepers(&mut chart);
        let columns = samples.len().div_ceil(SIGNAL_COLUMNS);
        let envelope = samples.chunks(columns).zip(self.positions().chunks(columns));
        chart.line(
            "a hair",
            envelope.flat_map(|(values, positions)| {
                let low = values.iter().copied().fold(f64::INFINITY, f64::min);
                let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
                [(positions[0], low), (positions[0], high)]
            }),
        );
        chart.into_svg()
    }

    fn map_chart(&self, title: &str, map: &TimeFrequencyMap) -> String {
        let rows = &map.frequencies_hz;
        let y = Axis::logarithmic("frequency in Hz", rows[0], rows[rows.len() - 1]);
        let title = format!("{title} in dB, darkest {DEPTH_DB} dB below the strongest");
        let mut chart = self.chart(&title, SIZE[1], y);
        if let Some(address) = address(map) {
            chart.image(&address);
        }
        self.mark_sleepers(&mut chart);
        chart.into_svg()
    }
}

/// The map as an image in a `data:` URL.
pub(crate) fn address(map: &TimeFrequencyMap) -> Option<String> {
    Some(format!("data:image/png;base64,{}", BASE64_STANDARD.encode(image(map)?)))
}

/// The map as a PNG image, with the highest frequency at the top.
fn image(map: &TimeFrequencyMap) -> Option<Vec<u8>> {
    let (width, height) = (map.times_s.len(), map.frequencies_hz.len());
    let peak = map.magnitudes.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
    let shade = |magnitude: f64| {
        let level = 20.0 * (magnitude / peak).max(1e-30).log10();
        (255.0 * (1.0 + level / DEPTH_DB).clamp(0.0, 1.0)).round() as u8
    };
    let pixels: Vec<u8> =
        (0..height).rev().flat_map(|row| map.row(row).iter().map(|m| shade(*m))).collect();
    let mut bytes = Vec::new();
    let (width, height) = (u32::try_from(width).ok()?, u32::try_from(height).ok()?);
    let mut encoder = png::Encoder::new(&mut bytes, width, height);
    encoder.set_color(png::ColorType::Indexed);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_palette(palette());
    let mut writer = encoder.write_header().ok()?;
    writer.write_image_data(&pixels).ok()?;
    writer.finish().ok()?;
    Some(bytes)
}

/// 256 colours from dark to bright, interpolated in viridis. The lightness increases uniformly, so that the
/// order is visible in grey print and with any colour vision.
fn palette() -> Vec<u8> {
    const ANCHORS: [[f64; 3]; 6] = [
        [68.0, 1.0, 84.0],
        [65.0, 68.0, 135.0],
        [42.0, 120.0, 142.0],
        [34.0, 168.0, 132.0],
        [122.0, 209.0, 81.0],
        [253.0, 231.0, 37.0],
    ];
    let colour = |index: u32| {
        let place = f64::from(index) / 255.0 * 5.0;
        let from = (place as usize).min(4);
        let share = place - from as f64;
        std::array::from_fn::<u8, 3, _>(|c| {
            (ANCHORS[from][c] * (1.0 - share) + ANCHORS[from + 1][c] * share).round() as u8
        })
    };
    (0..256).flat_map(colour).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_strongest_is_brightest_and_stands_where_its_frequency_is() {
        let map = TimeFrequencyMap {
            times_s: vec![0.0, 1.0],
            frequencies_hz: vec![100.0, 200.0],
            magnitudes: vec![1.0, 0.0, 0.1, 0.0],
        };
        let bytes = image(&map).unwrap();
        let mut decoder = png::Decoder::new(std::io::Cursor::new(bytes));
        decoder.set_transformations(png::Transformations::IDENTITY);
        let mut reader = decoder.read_info().unwrap();
        let mut pixels = [0; 4];
        reader.next_frame(&mut pixels).unwrap();
        // 200 Hz above 100 Hz; 20 dB below the peak is three fifths of 50 dB.
        assert_eq!(pixels, [153, 0, 255, 0]);
    }
}
