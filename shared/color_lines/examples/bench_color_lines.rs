//! scratch
use color_lines::*;
use std::time::Instant;
fn main() {
    let args: Vec<String> = std::env::args().collect();
    let rgb = image::open(&args[1]).unwrap().to_rgb8();
    let (w, h) = (rgb.width() as usize, rgb.height() as usize);
    let get = |i: usize, d: f64| args.get(i).and_then(|a| a.parse().ok()).unwrap_or(d);
    let (s, n, bins, hemi, c) = (get(2, 0.0), get(3, 150.0), get(4, 32.0), get(5, 10.0), get(6, 0.0));
    let values: Vec<f32> = (0..3).flat_map(|c| rgb.pixels().map(move |p| f32::from(p.0[c]))).collect();
    let img = Image::new([w, h], 3, &values).unwrap();
    let start = if n < 0.0 { Start::Contrast(-n - 1.0) } else { Start::Count(n as usize) };
    let set = Settings { hemispheres: hemi as usize, bins: bins as usize, start, spatial_weight: s, constrained: c > 0.0 };
    let mut best = f64::MAX;
    let mut fit = None;
    for _ in 0..5 {
        let t = Instant::now();
        fit = Some(Model::fit(&img, &set).unwrap());
        best = best.min(t.elapsed().as_secs_f64());
    }
    let mut fit = fit.unwrap();
    if std::env::var("UNIQUE").is_ok() {
        let mut u: Vec<[u8;3]> = rgb.pixels().map(|p| p.0).collect(); u.sort(); u.dedup();
        let n = u.len().isqrt(); u.truncate(n * (u.len() / n));
        let flat: Vec<u8> = u.iter().flatten().copied().collect();
        let v = band_sequential(&flat, 3);
        let im = Image::new([n, u.len() / n], 3, &v).unwrap();
        fit = Model::fit(&im, &set).unwrap();
        fit.labels = fit.model.labels(&img).unwrap();
    }
    let simple = fit.model.simplified(&img, &fit.labels).unwrap();
    let f = scores::fidelity(&values, &simple, 3, 255.0).unwrap();
    let l = scores::regions::LabelImage::new(w, &fit.labels).unwrap();
    println!("{} regions, {} iterations {:?}, {:.1} ms, PSNR {:.2}, {:?} density {:.4}", fit.model.regions.len(), fit.n_iterations.iter().sum::<usize>(), fit.n_iterations, best * 1e3, f.psnr_db, scores::regions::shapes(&l), scores::regions::contour_density(&l).one_side);
    if let Ok(p) = std::env::var("DUMP") { std::fs::write(p, fit.labels.iter().flat_map(|l| l.to_le_bytes()).collect::<Vec<_>>()).unwrap(); }
    for k in [3, 4, 5, 10, 20] {
        if s == 0.0 {
            let p = fit.model.projected(&img, k).unwrap();
            let d = project_onto_straight_lines(&img, k, StraightLines::Refined).unwrap();
            println!("K {k}: GCL {:.2}  DCL {:.2}", scores::fidelity(&values, &p.values, 3, 255.0).unwrap().psnr_db, scores::fidelity(&values, &d.values, 3, 255.0).unwrap().psnr_db);
        }
    }
}
