//! From text to an [`Expression`]: precedence climbing, errors with column and cure.
//!
//! Signs bind as in mathematics and Python: `-t^2` is `-(t^2)`, `2^3^2` is `2^(3^2)`, `a/b*c` is `(a/b)*c`.

use super::cure::{last_word, strange, unknown_function};
use super::expression::{Expression, Op};
use super::function::{Binary, Function, Unary, FUNCTIONS};

/// Longest text, in characters.
pub const LONGEST: usize = 4000;
/// Longest message of an error, in characters.
const LONGEST_MESSAGE: usize = 400;
/// Deepest nesting of parentheses and powers of powers: bounds the stack of the parser, whatever the text.
pub const DEEPEST: usize = 64;

impl Expression {
    /// Reads a formula. The message of an error gives the column, counted in characters from 1, and the cure.
    pub fn parse(text: &str) -> Result<Expression, String> {
        let characters: Vec<char> = text.chars().take(LONGEST + 1).collect();
        if characters.len() > LONGEST {
            return Err(format!(
                "the expression is longer than {LONGEST} characters; give names to its parts"
            ));
        }
        let mut parser = Parser {
            characters: &characters,
            at: 0,
            level: 0,
            length: 0,
            out: Expression {
                text: text.to_owned(),
                variables: Vec::new(),
                operations: Vec::new(),
                columns: Vec::new(),
                depth: 0,
            },
        };
        parser.skip_space();
        if parser.peek().is_none() {
            return Err("the expression is empty; write a number, a name or a formula".into());
        }
        parser.operation(LOWEST)?;
        match parser.peek() {
            None => Ok(parser.out),
            Some(_) => Err(parser.surplus()),
        }
    }
}

struct Parser<'a> {
    characters: &'a [char],
    at: usize,
    level: usize,
    /// Numbers on the stack after the operations written so far.
    length: usize,
    out: Expression,
}

/// How strongly operators bind.
const LOWEST: u8 = 0;
const SUM: u8 = 1;
const PRODUCT: u8 = 2;
const PREFIX: u8 = 3;
const POWER: u8 = 4;

impl Parser<'_> {
    fn peek(&self) -> Option<char> {
        self.characters.get(self.at).copied()
    }

    fn skip_space(&mut self) {
        while self.peek().is_some_and(char::is_whitespace) {
            self.at += 1;
        }
    }

    /// Passes over a character and the space behind it.
    fn pass(&mut self, characters: usize) {
        self.at += characters;
        self.skip_space();
    }

    fn emit(&mut self, op: Op, at: usize) {
        self.length = self.length + 1 - op.arguments();
        self.out.depth = self.out.depth.max(self.length);
        self.out.operations.push(op);
        self.out.columns.push(at + 1);
    }

    /// Runs a part of the grammar one level deeper.
    fn nested(&mut self, part: impl FnOnce(&mut Self) -> Result<(), String>) -> Result<(), String> {
        if self.level == DEEPEST {
            return Err(self.error(format!(
                "more than {DEEPEST} levels of nesting; give names to the parts"
            )));
        }
        self.level += 1;
        part(self)?;
        self.level -= 1;
        Ok(())
    }

    /// An operand and every operator behind it that binds more strongly than `bound`.
    fn operation(&mut self, bound: u8) -> Result<(), String> {
        let at = self.at;
        match self.peek() {
            Some('-') => {
                self.pass(1);
                self.nested(|p| p.operation(PREFIX))?;
                self.emit(Op::One(Unary::Negate), at);
            }
            Some('+') => {
                self.pass(1);
                self.nested(|p| p.operation(PREFIX))?;
            }
            _ => self.operand()?,
        }
        while let Some((operator, width, binding)) = self.operator() {
            if binding <= bound {
                break;
            }
            let at = self.at;
            self.pass(width);
            if binding == POWER {
                // From the right, and a sign may stand in the exponent: `2^-t`.
                self.nested(|p| p.operation(PREFIX))?;
            } else {
                self.operation(binding)?;
            }
            self.emit(Op::Two(operator), at);
        }
        Ok(())
    }

    /// The operator here, its width and how strongly it binds.
    fn operator(&self) -> Option<(Binary, usize, u8)> {
        let next = self.characters.get(self.at + 1);
        Some(match self.peek()? {
            '+' => (Binary::Add, 1, SUM),
            '-' => (Binary::Subtract, 1, SUM),
            '*' if next == Some(&'*') => (Binary::Power, 2, POWER),
            '*' => (Binary::Multiply, 1, PRODUCT),
            '/' => (Binary::Divide, 1, PRODUCT),
            '^' => (Binary::Power, 1, POWER),
            _ => return None,
        })
    }

    fn operand(&mut self) -> Result<(), String> {
        let at = self.at;
        match self.peek() {
            Some(c) if c.is_ascii_digit() || c == '.' => self.number(),
            Some(c) if c.is_ascii_alphabetic() || c == '_' => self.name(),
            Some('(') => {
                self.pass(1);
                if self.peek() == Some(')') {
                    return Err(self.error_at(at, "nothing stands between the parentheses".into()));
                }
                self.nested(|p| p.operation(LOWEST))?;
                self.close(at)
            }
            Some(')') => Err(self.error("a value is missing before \")\"".into())),
            None => Err(self.error("the expression ends where a value is expected".into())),
            Some(c) => Err(match strange(c) {
                Some(cure) => self.error(cure),
                None => self.error(format!("a value is missing before \"{c}\"")),
            }),
        }
    }

    fn close(&mut self, opened: usize) -> Result<(), String> {
        match self.peek() {
            Some(')') => {
                self.pass(1);
                Ok(())
            }
            None => Err(self.error_at(opened, "\"(\" is never closed; add \")\"".into())),
            Some(_) => Err(self.surplus()),
        }
    }

    /// `12`, `1.5`, `.5`, `5.`, `9.951e-3`.
    fn number(&mut self) -> Result<(), String> {
        let start = self.at;
        self.digits();
        if self.peek() == Some('.') {
            self.at += 1;
            self.digits();
        }
        if matches!(self.peek(), Some('e' | 'E')) {
            let sign = usize::from(matches!(self.characters.get(self.at + 1), Some('+' | '-')));
            if self
                .characters
                .get(self.at + 1 + sign)
                .is_some_and(char::is_ascii_digit)
            {
                self.at += 1 + sign;
                self.digits();
            }
        }
        let text: String = self.characters[start..self.at].iter().collect();
        match text.parse::<f64>() {
            Ok(x) if self.peek() != Some('.') && x.is_finite() => {
                self.emit(Op::Number(x), start);
                self.skip_space();
                Ok(())
            }
            Ok(x) if !x.is_finite() => {
                Err(self.error_at(start, format!("{text} is too large for a number")))
            }
            _ => Err(self.error_at(
                start,
                format!(
                    "{text}{} is no number; write it like 1.5 or 9.951e-3",
                    self.rest('.')
                ),
            )),
        }
    }

    fn digits(&mut self) {
        while self.peek().is_some_and(|c| c.is_ascii_digit()) {
            self.at += 1;
        }
    }

    /// What follows here of digits and the given character, for a message.
    fn rest(&self, also: char) -> String {
        let rest = self.characters[self.at..].iter();
        rest.take_while(|c| c.is_ascii_digit() || **c == also)
            .take(20)
            .collect()
    }

    /// A constant, a variable or a function with its arguments.
    fn name(&mut self) -> Result<(), String> {
        let start = self.at;
        let name = self.word();
        self.pass(name.chars().count());
        let function = FUNCTIONS.iter().find(|f| f.0 == name).map(|f| f.1);
        match (function, self.peek()) {
            (Some(function), Some('(')) => self.call(&name, function, start),
            (Some(_), _) => {
                Err(self.error_at(start, format!("{name} is a function; write {name}(...)")))
            }
            (None, Some('(')) => Err(self.error_at(start, unknown_function(&name))),
            (None, _) if name == "pi" || name == "PI" => {
                self.emit(Op::Number(std::f64::consts::PI), start);
                Ok(())
            }
            (None, _) => {
                let variables = &mut self.out.variables;
                let k = variables
                    .iter()
                    .position(|v| *v == name)
                    .unwrap_or_else(|| {
                        variables.push(name);
                        variables.len() - 1
                    });
                self.emit(Op::Variable(k), start);
                Ok(())
            }
        }
    }

    /// The letters, digits and underscores here.
    fn word(&self) -> String {
        let rest = self.characters[self.at..].iter();
        rest.take_while(|c| c.is_ascii_alphanumeric() || **c == '_')
            .collect()
    }

    fn call(&mut self, name: &str, function: Function, start: usize) -> Result<(), String> {
        let opened = self.at;
        self.pass(1);
        let mut count = 0;
        if self.peek() != Some(')') {
            loop {
                self.nested(|p| p.operation(LOWEST))?;
                count += 1;
                if let (Function::Many(f), true) = (function, count > 1) {
                    self.emit(Op::Two(f), start);
                }
                if self.peek() != Some(',') {
                    break;
                }
                self.pass(1);
            }
        }
        self.close(opened)?;
        let expected = match function {
            Function::One(f) if count == 1 => {
                self.emit(Op::One(f), start);
                return Ok(());
            }
            Function::Two(f) if count == 2 => {
                self.emit(Op::Two(f), start);
                return Ok(());
            }
            Function::Many(_) if count > 1 => return Ok(()),
            Function::One(_) => "one value",
            Function::Two(_) => "two values, with a comma between them",
            Function::Many(_) => "two values or more, with commas between them",
        };
        Err(self.error_at(start, format!("{name} takes {expected}; {count} found")))
    }

    /// What stands here although an operator or the end is expected.
    fn surplus(&self) -> String {
        let Some(c) = self.peek() else {
            return self.error("the expression is not complete".into());
        };
        if let Some(cure) = strange(c) {
            return self.error(cure);
        }
        match c {
            ')' => self.error("\")\" without a \"(\" before it; leave it out".into()),
            ',' => self.error(
                "a comma stands only between the values of a function; decimals are written with a point".into(),
            ),
            _ => {
                let before: String = self.characters[..self.at].iter().collect();
                let here = match self.word() {
                    word if word.is_empty() => c.to_string(),
                    word => word,
                };
                let left = last_word(before.trim_end());
                self.error(format!("an operator is missing between \"{left}\" and \"{here}\"; to multiply, write *"))
            }
        }
    }

    fn error(&self, message: String) -> String {
        self.error_at(self.at, message)
    }

    /// With the place; a word of the text may be as long as the text, and is not repeated whole.
    fn error_at(&self, at: usize, message: String) -> String {
        let shown = match message.char_indices().nth(LONGEST_MESSAGE) {
            Some((end, _)) => format!("{} ...", &message[..end]),
            None => message,
        };
        format!("column {}: {shown}", at + 1)
    }
}
