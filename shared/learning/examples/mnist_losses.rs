//! Tables 5.1 and 5.2 of the thesis in small: a U-Net of three levels on MNIST digits, trained with each loss.
//!
//! `cargo run --release -p learning --example mnist_losses -- binary|multiclass [SEEDS [IMAGES]]`, with `mnist/` of the real
//! data beside the project (see `tests/real_data`). The 10 000 test images of MNIST are all there is here: the first IMAGES
//! (default 1000) are learned from, 500 others validate, 500 others score. A pixel above half is digit; in `multiclass` its
//! class is the digit, and background is a class too. One row for each loss: mean and deviation of mIoU over the seeds.

use flate2::read::GzDecoder;
use learning::Random;
use learning::engine::{Border, Planes};
use learning::losses::{Hierarchy, Loss};
use learning::network::{NetworkSpec, Variables};
use learning::training::{Dataset, Example, TrainSettings, Trainer};
use std::io::{Error, ErrorKind, Read};
use std::path::Path;

const SIDE: usize = 28;

struct Digits {
    images: Vec<Vec<u8>>,
    digits: Vec<u8>,
    is_binary: bool,
}

impl Dataset for Digits {
    fn len(&self) -> usize {
        self.images.len()
    }
    fn example(&self, index: usize, _: Option<&mut Random>) -> Example {
        let mut input = Planes::zeros(1, SIDE, SIDE);
        for (y, row) in self.images[index].chunks_exact(SIDE).enumerate() {
            for (pixel, value) in input.row_mut(0, y).iter_mut().zip(row) {
                pixel[0] = f32::from(*value) / 255.0;
            }
        }
        let class = if self.is_binary { 1 } else { 1 + self.digits[index] };
        let truth = self.images[index].iter().map(|&value| if value > 127 { class } else { 0 }).collect();
        Example { input, truth }
    }
}

fn unzipped(path: &Path, header: usize) -> Result<Vec<u8>, Error> {
    let mut bytes = Vec::new();
    GzDecoder::new(std::fs::File::open(path)?).read_to_end(&mut bytes)?;
    bytes.get(header..).map(<[u8]>::to_vec).ok_or_else(|| Error::new(ErrorKind::UnexpectedEof, "no header"))
}

fn digits(folder: &Path, range: std::ops::Range<usize>, is_binary: bool) -> Result<Digits, Error> {
    let pixels = unzipped(&folder.join("t10k-images-idx3-ubyte.gz"), 16)?;
    let labels = unzipped(&folder.join("t10k-labels-idx1-ubyte.gz"), 8)?;
    let images = pixels.chunks_exact(SIDE * SIDE).skip(range.start).take(range.len()).map(<[u8]>::to_vec).collect();
    Ok(Digits { images, digits: labels[range].to_vec(), is_binary })
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut args = std::env::args().skip(1);
    let is_binary = match args.next().as_deref() {
        Some("binary") => true,
        Some("multiclass") => false,
        _ => return Err("usage: mnist_losses binary|multiclass [SEEDS [IMAGES]]".into()),
    };
    let n_seeds: u64 = args.next().map_or(Ok(3), |n| n.parse())?;
    let n_images: usize = args.next().map_or(Ok(1000), |n| n.parse())?;
    let Some(folder) = real_data::real_data("mnist") else { return Ok(()) };
    let data = digits(&folder, 0..n_images, is_binary)?;
    let validation = digits(&folder, 9000..9500, is_binary)?;
    let test = digits(&folder, 9500..10_000, is_binary)?;
    let power = |power| Loss::PowerJaccard { power };
    let losses = [
        ("CE", Loss::CrossEntropy),
        ("focal 2", Loss::Focal { gamma: 2.0 }),
        ("Dice", Loss::Dice),
        ("Jac. 1", power(1.0)),
        ("Jac. 1.25", power(1.25)),
        ("Jac. 1.5", power(1.5)),
        ("Jac. 1.75", power(1.75)),
        ("Jac. 2", power(2.0)),
    ];
    let n_classes = if is_binary { 2 } else { 11 };
    let (filter_counts, batches): (&[usize], &[usize]) = if is_binary { (&[2, 4], &[1]) } else { (&[8], &[10, 50]) };
    println!("| filters | batch | loss | mIoU | best |\n|---|---|---|---|---|");
    for &filters in filter_counts {
        for &batch in batches {
            for (name, loss) in &losses {
                let mut scores = Vec::new();
                for seed in 0..n_seeds {
                    let spec = NetworkSpec::Unet {
                        inputs: 1,
                        outputs: n_classes,
                        widths: vec![filters, 2 * filters, 4 * filters],
                        head: None,
                    };
                    let settings = TrainSettings {
                        seed,
                        epochs: if is_binary { 5 } else { 15 },
                        batch,
                        learning_rate: 1e-3,
                        average: 0.0,
                        patience: 5,
                        loss: loss.clone(),
                        hierarchy: false,
                        pixels: 0,
                    };
                    let variables = Variables::random(&spec, seed)?;
                    let tree = Hierarchy::new(vec![0; n_classes]);
                    let mut trainer = Trainer::new(settings, variables, (n_classes, 1), Border::Zero, tree)?;
                    while !trainer.is_done() {
                        trainer.epoch(&data, &validation, &mut |_, _| {})?;
                    }
                    let (_, confusion) = trainer.best_trainer()?.evaluate(&test)?;
                    scores.push(confusion.mean_iou().unwrap_or(0.0));
                }
                let mean = scores.iter().sum::<f64>() / scores.len() as f64;
                let deviation = (scores.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / scores.len() as f64).sqrt();
                let best = scores.iter().copied().fold(0.0, f64::max);
                println!("| {filters} | {batch} | {name} | {mean:.4} ± {deviation:.4} | {best:.4} |");
            }
        }
    }
    Ok(())
}
