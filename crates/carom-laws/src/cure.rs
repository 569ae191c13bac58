//! What people write that is no expression, and what to write instead.

use super::function::FUNCTIONS;

/// Other habits of naming them, with the cure.
const ELSEWHERE: [(&str, &str); 9] = [
    ("log", "ln (natural) or log10"),
    ("pow", "a^b"),
    ("sgn", "sign"),
    ("signum", "sign"),
    ("arcsin", "asin"),
    ("arccos", "acos"),
    ("arctan", "atan"),
    ("arctan2", "atan2"),
    ("fabs", "abs"),
];

/// The number, name or sign at the end.
pub fn last_word(text: &str) -> &str {
    let word = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '.';
    let start = text.trim_end_matches(word).len();
    match &text[start..] {
        "" => text.char_indices().last().map_or("", |(k, _)| &text[k..]),
        end => end,
    }
}

pub fn unknown_function(name: &str) -> String {
    if let Some((_, cure)) = ELSEWHERE.iter().find(|e| e.0 == name) {
        return format!("{name} is not known; write {cure}");
    }
    let known: Vec<&str> = FUNCTIONS.iter().map(|f| f.0).collect();
    format!(
        "{name} is no function; to multiply, write {name}*(...); functions are {}",
        known.join(", ")
    )
}

/// Signs that have no meaning here, with the cure.
pub fn strange(c: char) -> Option<String> {
    Some(match c {
        '<' | '>' | '=' | '!' => {
            format!("\"{c}\": expressions do not compare; use min, max, abs or sign")
        }
        '?' | ':' | '&' | '|' | '~' => {
            format!("\"{c}\": expressions do not choose; use min, max, abs or sign")
        }
        '[' | ']' | '{' | '}' => format!("\"{c}\": only round parentheses group"),
        '\u{d7}' | '\u{b7}' | '\u{22c5}' => format!("\"{c}\": to multiply, write *"),
        '\u{f7}' => format!("\"{c}\": to divide, write /"),
        '\u{2212}' | '\u{2013}' => format!("\"{c}\": this is no minus sign; write -"),
        '\u{b2}' | '\u{b3}' => format!("\"{c}\": powers are written with ^"),
        '\u{3c0}' => "\"\u{3c0}\": write pi".into(),
        '%' => {
            "\"%\": percentages and remainders are not known; divide by 100, or use floor".into()
        }
        c if c.is_ascii_alphanumeric() || "+-*/^().,_".contains(c) => return None,
        c => {
            format!("{c:?} has no meaning in an expression; names have ASCII letters, digits and _")
        }
    })
}
