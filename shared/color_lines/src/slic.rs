//! SLIC superpixels (Achanta et al., TPAMI 2012): the baseline of regions. Labels equal the output of scikit-image's
//! `slic` (`lab/peers/color_lines.py`).

/// Largest number of passes over the image.
const MAX_PASSES: usize = 10;
/// Superpixels smaller than this share of the mean size join a neighbor; none becomes larger than this multiple of it.
const SIZE_FACTORS: [f64; 2] = [0.5, 3.0];

/// A superpixel: row, column and Lab color divided by the compactness.
type Center = [f64; 5];

/// Superpixels of a color image, given as red, green, blue by pixel. Returns a label from 1 for each pixel, row by row.
/// `size` is columns, rows. `n_segments` is the approximate number of superpixels. `compactness` is the weight of the
/// distance in the image relative to the distance in Lab, usually 10.
pub fn slic(size: [usize; 2], rgb: &[[u8; 3]], n_segments: usize, compactness: f64) -> Vec<u32> {
    let [columns, rows] = size;
    let (low, high) = rgb.iter().flatten().fold((u8::MAX, 0), |(low, high), value| (low.min(*value), high.max(*value)));
    let range = f64::from(high.saturating_sub(low).max(1));
    let unit = |value: u8| f64::from(value - low) / range;
    let colors: Vec<[f64; 3]> = rgb.iter().map(|color| lab(color.map(unit)).map(|v| v / compactness)).collect();
    let step_for = |n: usize| ((columns * rows) as f64 / n.max(1) as f64).sqrt();
    let begin = (step_for(n_segments) / 2.0).floor() as usize;
    let step = step_for(n_segments).round().max(1.0);
    // The first pass uses no colors: each pixel joins the nearest center of the grid.
    let along = |side: usize| (begin..side).step_by(step as usize);
    let grid = along(rows).flat_map(|y| along(columns).map(move |x| (y, x)));
    let mut centers: Vec<Center> = grid.map(|(y, x)| [y as f64, x as f64, 0.0, 0.0, 0.0]).collect();
    let mut nearest = vec![0_usize; rgb.len()];
    for _ in 0..MAX_PASSES {
        // Rounding gives another number of centers than requested, and windows of another size.
        let reach = 2.0 * step_for(centers.len()).round();
        if !assign(size, &colors, &centers, [1.0 / (step * step), reach], &mut nearest) {
            break;
        }
        centers = means(columns, &colors, &nearest, centers.len());
    }
    connected(size, &nearest, centers.len())
}

/// Assigns each pixel to the nearest of the centers whose window contains it: at most `reach` px away in x and in y.
/// `weight` is the weight of squared pixel distances. Returns whether any distance was found.
fn assign(
    [columns, rows]: [usize; 2],
    colors: &[[f64; 3]],
    centers: &[Center],
    [weight, reach]: [f64; 2],
    nearest: &mut [usize],
) -> bool {
    let mut distances = vec![f64::MAX; colors.len()];
    let mut has_changed = false;
    for (number, [cy, cx, color @ ..]) in centers.iter().enumerate() {
        let window = |center: f64, side: usize| {
            (center - reach).max(0.0) as usize..((center + reach + 1.0).min(side as f64)) as usize
        };
        for y in window(*cy, rows) {
            let dy = (cy - y as f64).powi(2);
            for x in window(*cx, columns) {
                let at = y * columns + x;
                let of_color: f64 = colors[at].iter().zip(color).map(|(a, b)| (a - b).powi(2)).sum();
                let distance = (dy + (cx - x as f64).powi(2)) * weight + of_color;
                if distance < distances[at] {
                    distances[at] = distance;
                    nearest[at] = number;
                    has_changed = true;
                }
            }
        }
    }
    has_changed
}

/// The mean of the pixels of each center. A center without pixels becomes NaN, and no pixel is assigned to it any more.
fn means(columns: usize, colors: &[[f64; 3]], nearest: &[usize], n_centers: usize) -> Vec<Center> {
    let mut sums = vec![([0.0; 5], 0.0); n_centers];
    for (at, (number, [l, a, b])) in nearest.iter().zip(colors).enumerate() {
        let (sum, n) = &mut sums[*number];
        let features = [(at / columns) as f64, (at % columns) as f64, *l, *a, *b];
        sum.iter_mut().zip(features).for_each(|(sum, feature)| *sum += feature);
        *n += 1.0;
    }
    sums.into_iter().map(|(sum, n)| sum.map(|value| value / n)).collect()
}

/// Numbers the connected parts of superpixels in raster order. Small parts join the adjacent superpixel that was visited
/// last.
fn connected([columns, rows]: [usize; 2], nearest: &[usize], n_centers: usize) -> Vec<u32> {
    let mean_size = (columns * rows) as f64 / n_centers.max(1) as f64;
    let [min_size, max_size] = SIZE_FACTORS.map(|factor| (factor * mean_size) as usize);
    let mut labels = vec![0_u32; nearest.len()];
    let mut next = 1;
    for start in 0..nearest.len() {
        if labels[start] > 0 {
            continue;
        }
        labels[start] = next;
        let mut part = vec![start];
        let mut visited = 0;
        let mut adjacent = 0;
        while visited < part.len() && part.len() < max_size {
            let at = part[visited];
            let x = at % columns;
            let y = at / columns;
            let right = (x + 1 < columns).then(|| at + 1);
            let left = (x > 0).then(|| at - 1);
            let below = (y + 1 < rows).then(|| at + columns);
            let above = (y > 0).then(|| at.wrapping_sub(columns));
            for neighbor in [right, left, below, above].into_iter().flatten() {
                if nearest[neighbor] == nearest[start] && labels[neighbor] == 0 {
                    labels[neighbor] = next;
                    part.push(neighbor);
                    if part.len() >= max_size {
                        break;
                    }
                } else if labels[neighbor] > 0 && labels[neighbor] != next {
                    adjacent = labels[neighbor];
                }
            }
            visited += 1;
        }
        if part.len() < min_size {
            // Without an adjacent superpixel so far, the part is found again from its next pixel.
            for at in part {
                labels[at] = adjacent;
            }
        } else {
            next += 1;
        }
    }
    // Parts that never found a neighbor join the first superpixel.
    labels.iter_mut().filter(|label| **label == 0).for_each(|label| *label = 1);
    labels
}

/// CIE Lab (D65) of a color in sRGB, 0 to 1.
fn lab(rgb: [f64; 3]) -> [f64; 3] {
    let linear = rgb.map(|v| if v > 0.040_45 { ((v + 0.055) / 1.055).powf(2.4) } else { v / 12.92 });
    let dot = |row: [f64; 3]| row.iter().zip(linear).map(|(a, b)| a * b).sum::<f64>();
    let [x, y, z] = [
        dot([0.412_453, 0.357_580, 0.180_423]) / 0.950_47,
        dot([0.212_671, 0.715_160, 0.072_169]),
        dot([0.019_334, 0.119_193, 0.950_227]) / 1.088_83,
    ]
    .map(|v| if v > 0.008_856 { v.cbrt() } else { 7.787 * v + 16.0 / 116.0 });
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}
