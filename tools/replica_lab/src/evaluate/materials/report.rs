//! The tables of `replica-lab evaluate materials`.

use super::fused_classes::{FusedClasses, THRESHOLDS};
use super::tally::{RANGES_M, SCORES, Tally};
use materials::{Method, Smoothing};
use messages::{ClassId, MaterialId};
use scores::Confusion;
use serde_json::{Value, json};
use std::fmt::Write;

/// Results of all submaps.
pub struct Report<'a> {
    /// Source of the model.
    pub about: &'a str,
    /// Methods with their counts.
    pub tallies: &'a [(Method, Smoothing, Tally)],
    /// Classes with and without spectra.
    pub classes: &'a FusedClasses,
}

impl Report<'_> {
    /// Markdown tables.
    pub fn markdown(&self) -> String {
        [self.methods(), self.materials(), self.ranges(), self.index(), self.fused()].concat()
    }

    /// The tables as JSON.
    pub fn json(&self) -> Value {
        let methods = self.tallies.iter().map(|(method, smoothing, tally)| {
            json!({"method": method.name(), "smoothing": smoothing.name(), "accuracy": tally.all().overall_accuracy(),
                "mean_iou": tally.all().mean_iou()})
        });
        let tally = self.default_tally();
        let materials = MaterialId::ALL.iter().map(|material| {
            json!({"material": material.name(), "all": tally.all().class(*material as usize),
                "sun": tally.light[0].class(*material as usize), "shade": tally.light[1].class(*material as usize)})
        });
        let classes = self.classes.classes.iter().map(|confusion| {
            let of = |class: &ClassId| json!({"class": class.name(), "scores": confusion.class(*class as usize)});
            ClassId::ALL.iter().map(of).collect::<Value>()
        });
        json!({"model": self.about, "methods": methods.collect::<Value>(), "materials": materials.collect::<Value>(),
            "classes": classes.collect::<Value>()})
    }

    fn default_tally(&self) -> &Tally {
        let is_default = |(method, smoothing, _): &&(Method, Smoothing, Tally)| {
            (*method, *smoothing) == (Method::default(), Smoothing::default())
        };
        let (_, _, tally) = self.tallies.iter().find(is_default).unwrap_or(&self.tallies[0]);
        tally
    }

    fn methods(&self) -> String {
        let mut text = format!(
            "Model: {}\n\nAccuracy, % (in brackets: mIoU)\n\n| method | smoothing | all | sun | shade | known surfaces | other surfaces |\n\
             |---|---|---:|---:|---:|---:|---:|\n",
            self.about
        );
        for (method, smoothing, tally) in self.tallies {
            let _ = write!(text, "| {} | {} |", method.name(), smoothing.name());
            let [sun, shade] = &tally.light;
            let [known, other] = &tally.surfaces;
            for confusion in [&tally.all(), sun, shade, known, other] {
                let _ =
                    write!(text, " {} ({}) |", percent(confusion.overall_accuracy()), percent(confusion.mean_iou()));
            }
            text.push('\n');
        }
        text
    }

    fn materials(&self) -> String {
        let tally = self.default_tally();
        let mut text = "\nBy material, %\n\n| material | points | precision | recall | IoU | recall in the sun | in the shade | taken for |\n\
                        |---|---:|---:|---:|---:|---:|---:|---|\n"
            .to_owned();
        let all = tally.all();
        for material in MaterialId::ALL.iter().skip(1) {
            let of = |confusion: &Confusion| confusion.class(*material as usize);
            let scores = of(&all);
            if scores.n_truth + scores.n_predicted == 0 {
                continue;
            }
            let [sun, shade] = tally.light.each_ref().map(|light| percent(of(light).recall));
            let _ = writeln!(
                text,
                "| {} | {} | {} | {} | {} | {sun} | {shade} | {} |",
                material.name(),
                scores.n_truth,
                percent(scores.precision),
                percent(scores.recall),
                percent(scores.iou),
                most_confused(&all, *material as usize),
            );
        }
        text
    }

    fn ranges(&self) -> String {
        let tally = self.default_tally();
        let mut text = "\n| distance | points | accuracy, % | mIoU, % |\n|---|---:|---:|---:|\n".to_owned();
        let mut from = 0.0;
        for (end, confusion) in RANGES_M.iter().zip(&tally.ranges) {
            let name = if end.is_finite() { format!("{from} to {end} m") } else { format!("from {from} m") };
            text += &row(&name, confusion);
            from = *end;
        }
        text += "\n| score at least | points | accuracy, % | mIoU, % |\n|---|---:|---:|---:|\n";
        for (least, confusion) in SCORES.iter().zip(&tally.by_score) {
            text += &row(&least.to_string(), confusion);
        }
        text
    }

    fn index(&self) -> String {
        let mut text = "\nVegetation index against the classes vegetation and terrain, %\n\n| NDVI above | precision | recall | IoU |\n\
                        |---|---:|---:|---:|\n"
            .to_owned();
        for (threshold, confusion) in THRESHOLDS.iter().zip(&self.classes.index) {
            let scores = confusion.class(1);
            let [precision, recall, iou] = [scores.precision, scores.recall, scores.iou].map(percent);
            let _ = writeln!(text, "| {threshold} | {precision} | {recall} | {iou} |");
        }
        text
    }

    fn fused(&self) -> String {
        let [network, index, material, unsure] = &self.classes.classes;
        if network.n() == 0 {
            return String::new();
        }
        let mut text =
            "\nClasses of points with a spectrum: IoU, %\n\n| class | points | network | with NDVI | with material | with material where the network is unsure |\n\
                        |---|---:|---:|---:|---:|---:|\n"
                .to_owned();
        for class in ClassId::ALL {
            let of = |confusion: &Confusion| percent(confusion.class(*class as usize).iou);
            let n = network.class(*class as usize).n_truth;
            if n > 0 {
                let _ = writeln!(
                    text,
                    "| {} | {n} | {} | {} | {} | {} |",
                    class.name(),
                    of(network),
                    of(index),
                    of(material),
                    of(unsure)
                );
            }
        }
        for (name, score) in
            [("mean", Confusion::mean_iou as fn(&Confusion) -> Option<f64>), ("accuracy", Confusion::overall_accuracy)]
        {
            let scores: Vec<String> = self.classes.classes.iter().map(|confusion| percent(score(confusion))).collect();
            let _ = writeln!(text, "| {name} | {} | {} |", network.n(), scores.join(" | "));
        }
        text
    }
}

fn row(name: &str, confusion: &Confusion) -> String {
    let accuracy = percent(confusion.overall_accuracy());
    let iou = percent(confusion.mean_iou());
    format!("| {name} | {} | {accuracy} | {iou} |\n", confusion.n())
}

fn percent(share: Option<f64>) -> String {
    share.map_or_else(|| "-".to_owned(), |share| format!("{:.1}", 100.0 * share))
}

/// The most frequent wrong material, with its share.
fn most_confused(confusion: &Confusion, material: usize) -> String {
    let n = confusion.class(material).n_truth.max(1);
    let others = MaterialId::ALL.iter().filter(|other| **other as usize != material);
    let most = others.max_by_key(|other| confusion.count(material, **other as usize));
    let count = |other: &MaterialId| confusion.count(material, *other as usize);
    most.filter(|other| count(other) > 0)
        .map_or_else(String::new, |other| format!("{} ({:.0})", other.name(), 100.0 * count(other) as f64 / n as f64))
}
