//! Runs and times operators on raw images, for the comparison with other libraries in `lab/peers/morphology.py`.
//!
//! A line of stdin is a job: `OPERATOR TYPE ROWS COLS CONNECTIVITY ARGUMENT OUTPUT INPUT...`. Files are in row order and native byte order,
//! connectivity is 4 or 8. Each following line `run` runs the job once and prints the CPU time, ns. Any other line writes the result and
//! prints `done`.

use morphology::{Connectivity, Element, Height, Level};
use ndarray::Array2;
use rustix::time::{ClockId, clock_gettime};
use std::path::Path;

struct Job<'a> {
    operator: &'a str,
    shape: (usize, usize),
    connectivity: Connectivity,
    argument: &'a str,
    output: &'a Path,
    inputs: Vec<&'a Path>,
}

trait Pixel: Copy {
    const SIZE: usize;
    fn read(bytes: &[u8]) -> Self;
    fn write(self, into: &mut Vec<u8>);
}
macro_rules! pixels {
    ($($t:ty),*) => {$(
        impl Pixel for $t {
            const SIZE: usize = size_of::<$t>();
            fn read(bytes: &[u8]) -> Self {
                <$t>::from_ne_bytes(bytes.try_into().expect("as many bytes as a pixel has"))
            }
            fn write(self, into: &mut Vec<u8>) {
                into.extend_from_slice(&self.to_ne_bytes());
            }
        }
    )*};
}
pixels!(u8, u16, u32, f32, f64);
impl Pixel for bool {
    const SIZE: usize = 1;
    fn read(bytes: &[u8]) -> Self {
        bytes[0] != 0
    }
    fn write(self, into: &mut Vec<u8>) {
        into.push(u8::from(self));
    }
}

impl Job<'_> {
    fn image<T: Pixel>(&self, idx: usize) -> Array2<T> {
        let bytes = std::fs::read(self.inputs[idx]).expect("the input can be read");
        let pixels = bytes.chunks_exact(T::SIZE).map(T::read).collect();
        Array2::from_shape_vec(self.shape, pixels).expect("the input has that size")
    }

    fn time<T: Pixel>(&self, mut work: impl FnMut() -> Array2<T>) {
        let cpu_nanos = || {
            let time = clock_gettime(ClockId::ProcessCPUTime);
            time.tv_sec * 1_000_000_000 + time.tv_nsec
        };
        let mut result = None;
        while read_line().is_some_and(|line| line == "run") {
            // As in the other libraries, the previous result is freed first.
            drop(result.take());
            let begun = cpu_nanos();
            result = Some(work());
            println!("{}", cpu_nanos() - begun);
        }
        let mut bytes = Vec::new();
        result.expect("at least one run").iter().for_each(|pixel| pixel.write(&mut bytes));
        std::fs::write(self.output, bytes).expect("the output can be written");
        println!("done");
    }

    fn element(&self) -> Element {
        let (kind, sizes) = self.argument.split_once(':').expect("KIND:SIZES");
        let sizes: Vec<isize> = sizes.split(',').map(|size| size.parse().expect("a number")).collect();
        match kind {
            "rectangle" => Element::rectangle(sizes[0] as usize, sizes[1] as usize),
            "disc" => Element::disc(sizes[0] as usize),
            "line" => Element::line(sizes[0], sizes[1]),
            _ => panic!("unknown element {kind}"),
        }
    }

    fn run<T: Pixel + Level + Height + std::str::FromStr<Err: std::fmt::Debug>>(&self) {
        let image: Array2<T> = self.image(0);
        let connectivity = self.connectivity;
        let area = || self.argument.parse().expect("an area");
        match self.operator {
            "dilate" => self.time(|| morphology::dilate(&image, self.element())),
            "erode" => self.time(|| morphology::erode(&image, self.element())),
            "opening" => self.time(|| morphology::opening(&image, self.element())),
            "closing" => self.time(|| morphology::closing(&image, self.element())),
            "area_opening" => self.time(|| morphology::area_opening(&image, area(), connectivity)),
            "area_closing" => self.time(|| morphology::area_closing(&image, area(), connectivity)),
            "regional_maxima" => self.time(|| morphology::regional_maxima(&image, connectivity)),
            "regional_minima" => self.time(|| morphology::regional_minima(&image, connectivity)),
            "h_maxima" => {
                let height = self.argument.parse().expect("a height");
                self.time(|| morphology::h_maxima(&image, height, connectivity));
            }
            "reconstruct_by_dilation" => {
                let marker = self.image(1);
                self.time(|| morphology::reconstruct_by_dilation(&marker, &image, connectivity));
            }
            "reconstruct_by_erosion" => {
                let marker = self.image(1);
                self.time(|| morphology::reconstruct_by_erosion(&marker, &image, connectivity));
            }
            "watershed" => {
                let markers = self.image(1);
                let mask = self.image(2);
                self.time(|| morphology::watershed(&image, &markers, &mask, connectivity));
            }
            other => panic!("unknown operator {other}"),
        }
    }

    fn zones(&self) {
        let heights = self.image(0);
        let everywhere = Array2::from_elem(self.shape, true);
        let lambda = self.argument.parse().expect("a height");
        self.time(|| morphology::quasi_flat_zones(&heights, &everywhere, lambda, self.connectivity).image);
    }

    fn run_on_mask(&self) {
        let mask: Array2<bool> = self.image(0);
        match self.operator {
            "components" => self.time(|| morphology::connected_components(&mask, self.connectivity).image),
            "geodesic_distances" => {
                let seeds: Array2<bool> = self.image(1);
                let seeds: Vec<_> = seeds.indexed_iter().filter(|(_, is_seed)| **is_seed).map(|(at, _)| at).collect();
                self.time(|| morphology::geodesic_distances(&mask, &seeds));
            }
            "area_closing" => {
                let area = self.argument.parse().expect("an area");
                self.time(|| morphology::area_closing(&mask, area, self.connectivity));
            }
            "dilate" => self.time(|| morphology::dilate(&mask, self.element())),
            other => panic!("unknown operator on a mask {other}"),
        }
    }
}

/// The next line of stdin, `None` after the last.
fn read_line() -> Option<String> {
    let mut line = String::new();
    let n = std::io::stdin().read_line(&mut line).expect("text");
    (n > 0).then(|| line.trim_end().to_owned())
}

fn main() {
    while let Some(line) = read_line() {
        let words: Vec<&str> = line.split_whitespace().collect();
        let [operator, kind, rows, cols, connectivity, argument, output, inputs @ ..] = words.as_slice() else {
            panic!("a job has at least 8 words: {line}");
        };
        let number = |text: &str| text.parse::<usize>().expect("a number");
        let job = Job {
            operator,
            shape: (number(rows), number(cols)),
            connectivity: if *connectivity == "4" { Connectivity::Four } else { Connectivity::Eight },
            argument,
            output: Path::new(output),
            inputs: inputs.iter().map(Path::new).collect(),
        };
        match *kind {
            "uint8" => job.run::<u8>(),
            "uint16" => job.run::<u16>(),
            "float32" if job.operator == "quasi_flat_zones" => job.zones(),
            "float32" => job.run::<f32>(),
            "bool" => job.run_on_mask(),
            other => panic!("unknown type {other}"),
        }
    }
}
