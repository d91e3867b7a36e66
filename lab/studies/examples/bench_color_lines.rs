//! Times the model of an image on one thread, and writes its fits for `lab/peers/color_lines.py`.
//!
//! `bench_color_lines IMAGE|CUBE SPATIAL_WEIGHT GAUSSIANS RUNS [FOLDER]` prints CPU milliseconds (fastest of the runs) of the parts and of the
//! whole, PSNR, and iterations. FOLDER receives the points, starts and fitted Gaussians of each hemisphere, and of a color image labels,
//! superpixels and their scores.

use anyhow::Context;
use color_lines::{Image, Model, Settings, Start, band_sequential, mixture, slic};
use rustix::time::{ClockId, clock_gettime};
use scores::regions::{LabelImage, boundary_scores, contour_density, explained_variation, overlap_scores, shapes};
use std::path::Path;

fn main() -> anyhow::Result<()> {
    // Hemispheres are fitted in parallel; in a pool of only this thread, its CPU time is the CPU time of the work.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build()?;
    pool.install(bench)
}

fn bench() -> anyhow::Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [input, spatial_weight, gaussians, runs, folder @ ..] = arguments.as_slice() else {
        anyhow::bail!("usage: bench_color_lines IMAGE|CUBE SPATIAL_WEIGHT GAUSSIANS RUNS [FOLDER]")
    };
    let path = Path::new(input);
    let is_cube = path.extension().is_some_and(|ending| ["hdr", "tif"].iter().any(|known| ending == *known));
    let (size, n_bands, values) = if is_cube {
        let cube = formats::band_image::read(path)?;
        (cube.size, cube.n_bands, cube.values)
    } else {
        let image = image::open(path)?.to_rgb8();
        ([image.width() as usize, image.height() as usize], 3, band_sequential(image.as_raw(), 3))
    };
    let image = Image::new(size, n_bands, &values)?;
    let start = Start::Count(gaussians.parse()?);
    let settings = Settings { start, spatial_weight: spatial_weight.parse()?, ..Settings::default() };
    let runs: usize = runs.parse()?;
    let slices = Model::slices(&image, &settings)?;
    let starts: Vec<_> = slices.iter().map(|slice| mixture::start(&slice.points, &slice.means)).collect();
    let mut mixtures = Vec::new();
    let fits_ms = fastest_ms(runs, || {
        mixtures =
            slices.iter().zip(&starts).map(|(slice, start)| mixture::fit(&slice.points, start.clone())).collect();
    });
    let mut fit = Model::fit(&image, &settings)?;
    let model_ms = fastest_ms(runs, || fit = Model::fit(&image, &settings).expect("fits as before"));
    let mut simplified = Vec::new();
    let simplified_ms = fastest_ms(runs, || {
        simplified = fit.model.simplified(&image, &fit.labels).expect("the image of the model");
    });
    let fidelity = scores::fidelity(&values, &simplified, n_bands, f64::from(image.largest())).context("no pixels")?;
    println!(
        "fits {fits_ms:.1} ms, model {model_ms:.1} ms, simplified image {simplified_ms:.1} ms; {} Gaussians, {} iterations, PSNR {:.2} dB",
        fit.model.regions.len(),
        fit.n_iterations.iter().sum::<usize>(),
        fidelity.psnr_db
    );
    let [folder] = folder else { return Ok(()) };
    let folder = Path::new(folder);
    for (slice, (start, mixture)) in slices.iter().zip(starts.iter().zip(&mixtures)) {
        let name = |ending: &str| folder.join(format!("{}.{ending}", slice.hemisphere));
        let points: Vec<u8> = slice.points.0.iter().flatten().flat_map(|value| value.to_le_bytes()).collect();
        std::fs::write(name("points"), points)?;
        std::fs::write(name("json"), serde_json::to_string(&(start, &mixture.gaussians, mixture.n_iterations))?)?;
    }
    let bytes = |labels: &[u32]| labels.iter().flat_map(|label| label.to_le_bytes()).collect::<Vec<u8>>();
    std::fs::write(folder.join("labels"), bytes(&fit.labels))?;
    if is_cube {
        return Ok(());
    }
    let rgb: Vec<[u8; 3]> = (0..image.n_pixels()).map(|at| [0, 1, 2].map(|band| image.band(band)[at] as u8)).collect();
    // Decoders of JPEG differ by a level here and there.
    std::fs::write(folder.join("rgb"), rgb.concat())?;
    let superpixels = slic(size, &rgb, 200, 10.0);
    std::fs::write(folder.join("slic"), bytes(&superpixels))?;
    // The regions of the Gaussians serve as segmentation: scores compare any two label images.
    let images = [&superpixels, &fit.labels].map(|labels| LabelImage::new(size[0], labels));
    let [Some(superpixels), Some(regions)] = images else { anyhow::bail!("the labels are not an image") };
    let of_image = |image: &LabelImage<'_>| {
        let shape = shapes(image);
        let density = contour_density(image);
        let variation = explained_variation(image, &values);
        [shape.extent, shape.solidity, shape.compactness, density.both_sides, density.one_side, variation]
    };
    let of_distance = |distance| {
        let found = boundary_scores(&superpixels, &regions, distance);
        [found.recall, found.precision, found.benchmark_precision]
    };
    let overlap = overlap_scores(&superpixels, &regions);
    let overlap = [overlap.under_segmentation_bergh, overlap.under_segmentation_np, overlap.achievable_accuracy];
    let scores = (of_image(&superpixels), of_image(&regions), of_distance(1), of_distance(2), overlap);
    std::fs::write(folder.join("scores.json"), serde_json::to_string(&scores)?)?;
    Ok(())
}

/// CPU time of this thread, of the fastest run.
fn fastest_ms(runs: usize, mut work: impl FnMut()) -> f64 {
    let now_ms = || {
        let now = clock_gettime(ClockId::ThreadCPUTime);
        now.tv_sec as f64 * 1e3 + now.tv_nsec as f64 * 1e-6
    };
    let mut fastest = f64::INFINITY;
    for _ in 0..runs.max(1) {
        let begin = now_ms();
        work();
        fastest = fastest.min(now_ms() - begin);
    }
    fastest
}
