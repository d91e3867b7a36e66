//! The result of a check.

use serde::Serialize;
use std::fmt;

/// The answer of a check.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Answer {
    /// Rig and data agree.
    Fits,
    /// Rig and data disagree.
    Doubt,
    /// The data does not determine it.
    Unknown,
}

impl Answer {
    /// The word used in reports.
    pub const fn word(self) -> &'static str {
        match self {
            Self::Fits => "fits",
            Self::Doubt => "DOUBT",
            Self::Unknown => "unknown",
        }
    }
}

/// The result of one check of one sensor.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Verdict {
    /// Name of the check.
    pub check: &'static str,
    /// Name of the sensor.
    pub subject: String,
    /// The answer.
    pub answer: Answer,
    /// The measured value with its unit, or the reason why it is missing.
    pub value: String,
    /// The limit of the value; empty without a limit.
    pub limit: String,
    /// Advice on what to change; empty unless the answer is a doubt.
    pub advice: String,
}

impl Verdict {
    /// A measured value within or beyond its limit.
    pub(crate) fn new(
        check: &'static str,
        subject: &str,
        is_within: bool,
        [value, limit, advice]: [String; 3],
    ) -> Self {
        let answer = if is_within { Answer::Fits } else { Answer::Doubt };
        let advice = if is_within { String::new() } else { advice };
        Self { check, subject: subject.to_owned(), answer, value, limit, advice }
    }

    /// A check without an answer.
    pub(crate) fn unknown(check: &'static str, subject: &str, reason: impl Into<String>) -> Self {
        let limit = String::new();
        let advice = String::new();
        Self { check, subject: subject.to_owned(), answer: Answer::Unknown, value: reason.into(), limit, advice }
    }

    /// A verdict for a sensor that can be checked only after the LiDAR fits.
    pub(crate) fn after_lidar(subject: &str) -> Self {
        Self::unknown("mounting", subject, "not judged before the doubts about the LiDAR are settled")
    }

    /// Whether it is a doubt.
    pub fn is_doubt(&self) -> bool {
        self.answer == Answer::Doubt
    }
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { check, subject, answer, value, limit, advice } = self;
        write!(f, "{:<7} {subject} {check}: {value}", answer.word())?;
        if !limit.is_empty() {
            write!(f, " (limit {limit})")?;
        }
        if advice.is_empty() { Ok(()) } else { write!(f, "\n        {advice}") }
    }
}
