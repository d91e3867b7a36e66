//! The end of a run: its summary, its last words, its exit code.

use super::Supervisor;
use serde_json::json;
use stage::exit;
use stage::process::usage;
use stage::summary::{StageSummary, Summary, Total, rate};
use std::collections::BTreeMap;

impl Supervisor {
    pub(super) fn was_cut_short(&self) -> bool {
        let source = self.plan.stages.first().and_then(|source| self.health.get(&source.name));
        source.is_some_and(|health| health.drained)
    }

    pub(super) fn finish(mut self, outcome: &'static str) -> Result<u8, String> {
        let wall_s = self.begun.elapsed().as_secs_f64();
        let figures = self.health.iter().map(|(name, health)| (name.as_str(), health));
        if let Some(text) = self.metrics.write(figures, self.domain.used_bytes(), self.restarts) {
            self.screen.say(&text);
        }
        let figures = self.health.iter().map(|(name, health)| (name.as_str(), health));
        if let Some(text) = self.costs.as_mut().and_then(|costs| costs.write(figures)) {
            self.screen.say(&text);
        }
        self.close_swap();
        let sink = self.plan.stages.last().and_then(|sink| self.health.get(&sink.name)).cloned();
        let stages: Vec<StageSummary> = self
            .plan
            .stages
            .iter()
            .map(|stage| {
                let health = self.health.remove(&stage.name).unwrap_or_default();
                let faults = self.faults.iter().filter(|fault| fault.stage == stage.name).count() as u32;
                let cpu_s = self.cpu_s.get(&stage.name).copied().unwrap_or_default();
                StageSummary::new(&stage.name, &stage.program, health, cpu_s, faults, wall_s)
            })
            .collect();
        let drive_s =
            sink.and_then(|h| Some(h.drive_time?.saturating_sub(h.drive_begin?) as f64 * 1e-9)).unwrap_or_default();
        let total = self.total(&stages, drive_s, wall_s);
        let has_lost = self.is_live() && (!self.faults.is_empty() || !total.dropped.is_empty());
        let incomplete = outcome == "drained" || (outcome == "done" && has_lost);
        let faults = self.faults.iter().map(|fault| format!("[{}] {}", fault.stage, fault.text)).collect();
        let swaps = std::mem::take(&mut self.record.swaps);
        let summary = Summary { outcome: outcome.to_owned(), faults, swaps, total, stages };
        summary.write(&self.plan.context.output)?;
        // It learns from the summary of a run that was cut short, so it can be waited for only now.
        let recorded = self.recorder.take().map_or(Ok(()), |recorder| recorder.finish(outcome));
        if let Err(words) = &recorded {
            self.screen.say(words);
        }
        self.control.end(outcome);
        let total = &summary.total;
        let text = format!(
            "{outcome}: {:.1} s of drive in {:.1} s ({:.2} times real time), {:.2} M points, {} restarts; see {}",
            total.drive_s,
            total.wall_s,
            total.times_real_time,
            total.points as f64 * 1e-6,
            total.restarts,
            self.plan.context.output.join("summary.json").display()
        );
        self.screen.tell("done", &text, json!({"outcome": outcome, "total": total}));
        for (topic, n) in &total.dropped {
            self.screen.say(&format!("dropped: {n} messages of {topic}"));
        }
        Ok(match outcome {
            "done" if recorded.is_err() => exit::INCOMPLETE,
            _ if incomplete => exit::INCOMPLETE,
            "done" => exit::DONE,
            _ => exit::FAILED,
        })
    }

    fn total(&self, stages: &[StageSummary], drive_s: f64, wall_s: f64) -> Total {
        // The plan is in the order of the dataflow: the sink comes last.
        let Some(sink) = stages.last() else { return Total::default() };
        Total {
            drive_s,
            wall_s,
            times_real_time: if wall_s > 0.0 { drive_s / wall_s } else { 0.0 },
            points: sink.points,
            points_per_s: rate(sink.points, wall_s),
            cpu_s: stages.iter().map(|stage| stage.cpu_s).sum(),
            supervisor_cpu_s: usage().cpu_s - self.own_cpu_s,
            peak_shared_memory_bytes: self.peak_shared_memory,
            restarts: self.restarts,
            dropped: dropped(stages),
            latency: sink.age,
        }
    }
}

/// Messages that some consumer did not get, by topic.
fn dropped(stages: &[StageSummary]) -> BTreeMap<String, u64> {
    let mut dropped = BTreeMap::new();
    for (topic, traffic) in stages.iter().flat_map(|stage| &stage.inputs).filter(|(_, traffic)| traffic.dropped > 0) {
        *dropped.entry(topic.clone()).or_default() += traffic.dropped;
    }
    dropped
}
