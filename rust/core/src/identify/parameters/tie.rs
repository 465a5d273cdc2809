//! Ties: a parameter that follows from others by an expression, kept as text.
//!
//! The text is read by descent through its grammar into steps for a stack, and nothing else is ever
//! done with it: numbers, names of parameters, `+ - * / **`, brackets, `sqrt`, `exp` and `log`, with
//! the precedence that they have in Python. Length and depth are limited.

use crate::error::{Error, Result, shown_text};
use crate::models::ParameterInfo;

/// Most characters of an expression.
const MOST_CHARACTERS: usize = 500;

/// Most levels of brackets, signs and powers within each other.
const MOST_LEVELS: usize = 40;

/// One step of an evaluation on a stack.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Step {
    Number(f64),
    Parameter(usize),
    Negate,
    Add,
    Subtract,
    Multiply,
    Divide,
    Power,
    Sqrt,
    Exp,
    Log,
}

/// A tied parameter with its expression.
#[derive(Clone, Debug, PartialEq)]
pub struct Tie {
    /// Place of the parameter.
    pub parameter: usize,
    /// The expression as the caller wrote it, in one line.
    pub text: String,
    steps: Vec<Step>,
}

impl Tie {
    /// Reads the expression of a parameter.
    ///
    /// # Errors
    /// [`Error::Parameter`] that says where the text is no expression of parameters.
    pub fn read(infos: &[ParameterInfo], parameter: usize, text: &str) -> Result<Self> {
        let name = infos.get(parameter).map_or("", |info| info.name);
        let argument = format!("tie of {name}");
        let characters: Vec<char> = text.chars().collect();
        let mut reader = Reader { infos, argument, text, characters, at: 0, steps: Vec::new() };
        if reader.characters.len() > MOST_CHARACTERS {
            return Err(reader.refuse(format!("{MOST_CHARACTERS} characters at most")));
        }
        reader.sum(0)?;
        if reader.peek().is_some() {
            return Err(reader.expected("an operator"));
        }
        let steps = reader.steps;
        Ok(Self { parameter, text: in_one_line(text), steps })
    }

    /// The value with these values of all parameters; NaN or infinite where there is none.
    #[must_use]
    pub fn value(&self, parameters: &[f64]) -> f64 {
        let mut stack: Vec<f64> = Vec::with_capacity(8);
        for step in &self.steps {
            let value = match *step {
                Step::Number(number) => number,
                Step::Parameter(place) => parameters.get(place).copied().unwrap_or(f64::NAN),
                Step::Negate | Step::Sqrt | Step::Exp | Step::Log => {
                    let a = stack.pop().unwrap_or(f64::NAN);
                    match *step {
                        Step::Sqrt => libm::sqrt(a),
                        Step::Exp => libm::exp(a),
                        Step::Log => libm::log(a),
                        _ => -a,
                    }
                }
                _ => {
                    let b = stack.pop().unwrap_or(f64::NAN);
                    let a = stack.pop().unwrap_or(f64::NAN);
                    match *step {
                        Step::Add => a + b,
                        Step::Subtract => a - b,
                        Step::Multiply => a * b,
                        Step::Divide => a / b,
                        _ => libm::pow(a, b),
                    }
                }
            };
            stack.push(value);
        }
        stack.pop().unwrap_or(f64::NAN)
    }

    /// Places of the parameters that it names.
    pub fn names(&self) -> impl Iterator<Item = usize> {
        self.steps.iter().filter_map(|step| match step {
            Step::Parameter(place) => Some(*place),
            _ => None,
        })
    }
}

/// Puts ties in an order in which each follows those that it refers to.
///
/// # Errors
/// [`Error::Parameter`] that shows the circle, where there is one.
pub(in crate::identify) fn in_order(
    infos: &[ParameterInfo],
    mut ties: Vec<Tie>,
) -> Result<Vec<Tie>> {
    let mut ordered: Vec<Tie> = Vec::with_capacity(ties.len());
    while !ties.is_empty() {
        let waits = |tie: &Tie| tie.names().any(|name| ties.iter().any(|t| t.parameter == name));
        let Some(next) = ties.iter().position(|tie| !waits(tie)) else {
            return Err(circle(infos, &ties));
        };
        ordered.push(ties.remove(next));
    }
    Ok(ordered)
}

/// The circle in ties of which each refers to another one of them.
fn circle(infos: &[ParameterInfo], ties: &[Tie]) -> Error {
    let mut path: Vec<usize> = ties.first().map(|tie| tie.parameter).into_iter().collect();
    let next = |last: usize| {
        let tie = ties.iter().find(|tie| tie.parameter == last)?;
        tie.names().find(|&name| ties.iter().any(|other| other.parameter == name))
    };
    while let Some(name) = path.last().and_then(|&last| next(last)) {
        if let Some(begin) = path.iter().position(|&seen| seen == name) {
            path.drain(..begin);
            path.push(name);
            break;
        }
        path.push(name);
    }
    let names = path.iter().filter_map(|&place| infos.get(place)).map(|info| info.name);
    let shown = names.collect::<Vec<_>>().join(" -> ");
    Error::parameter("ties", format!("a circle, {shown}"), "none that refer to each other")
}

/// A text that was understood, with single blanks.
pub(in crate::identify) fn in_one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// A text on its way to steps.
struct Reader<'a> {
    infos: &'a [ParameterInfo],
    argument: String,
    text: &'a str,
    characters: Vec<char>,
    at: usize,
    steps: Vec<Step>,
}

impl Reader<'_> {
    /// The next character that is no blank.
    fn peek(&mut self) -> Option<char> {
        while self.characters.get(self.at).is_some_and(|c| c.is_whitespace()) {
            self.at += 1;
        }
        self.characters.get(self.at).copied()
    }

    /// Passes over a character if it is the next one.
    fn takes(&mut self, wanted: char) -> bool {
        let found = self.peek() == Some(wanted);
        self.at += usize::from(found);
        found
    }

    /// Passes over `**` if it is next.
    fn takes_power(&mut self) -> bool {
        let found = self.peek() == Some('*') && self.characters.get(self.at + 1) == Some(&'*');
        self.at += 2 * usize::from(found);
        found
    }

    fn refuse(&self, expected: String) -> Error {
        Error::parameter(self.argument.as_str(), shown_text(self.text), expected)
    }

    fn expected(&mut self, what: &str) -> Error {
        let place = match self.peek() {
            None => "at its end".to_owned(),
            Some(found) => {
                format!("at character {}, where '{}' is", self.at + 1, found.escape_debug())
            }
        };
        self.refuse(format!("{what} {place}"))
    }

    /// Goes a level deeper.
    fn deeper(&self, level: usize) -> Result<usize> {
        if level < MOST_LEVELS {
            return Ok(level + 1);
        }
        Err(self.refuse(format!("{MOST_LEVELS} levels of brackets, signs and powers at most")))
    }

    /// Products, added and subtracted.
    fn sum(&mut self, level: usize) -> Result<()> {
        self.product(level)?;
        loop {
            let step = match self.peek() {
                Some('+') => Step::Add,
                Some('-') => Step::Subtract,
                _ => return Ok(()),
            };
            self.at += 1;
            self.product(level)?;
            self.steps.push(step);
        }
    }

    /// Factors, multiplied and divided.
    fn product(&mut self, level: usize) -> Result<()> {
        self.signed(level)?;
        loop {
            let step = match self.peek() {
                Some('*') => Step::Multiply,
                Some('/') => Step::Divide,
                _ => return Ok(()),
            };
            self.at += 1;
            self.signed(level)?;
            self.steps.push(step);
        }
    }

    /// A power with signs before it, which it binds closer than.
    fn signed(&mut self, level: usize) -> Result<()> {
        let level = self.deeper(level)?;
        if self.takes('-') {
            self.signed(level)?;
            self.steps.push(Step::Negate);
            return Ok(());
        }
        if self.takes('+') {
            return self.signed(level);
        }
        self.atom(level)?;
        if self.takes_power() {
            self.signed(level)?;
            self.steps.push(Step::Power);
        }
        Ok(())
    }

    /// A number, a parameter, a function or what is in brackets.
    fn atom(&mut self, level: usize) -> Result<()> {
        match self.peek() {
            Some('(') => self.bracket(level),
            Some(c) if c.is_ascii_digit() || c == '.' => self.number(),
            Some(c) if c.is_ascii_alphabetic() || c == '_' => self.name(level),
            _ => Err(self.expected("a number, a parameter or a bracket")),
        }
    }

    fn bracket(&mut self, level: usize) -> Result<()> {
        self.at += 1;
        self.sum(level)?;
        if self.takes(')') {
            return Ok(());
        }
        Err(self.expected("an operator or a closing bracket"))
    }

    /// Passes over characters while they are such.
    fn run(&mut self, such: impl Fn(char) -> bool) -> usize {
        let from = self.at;
        while self.characters.get(self.at).is_some_and(|&c| such(c)) {
            self.at += 1;
        }
        self.at - from
    }

    fn number(&mut self) -> Result<()> {
        let from = self.at;
        let digit = |c: char| c.is_ascii_digit();
        self.run(digit);
        if self.characters.get(self.at) == Some(&'.') {
            self.at += 1;
            self.run(digit);
        }
        let mantissa = self.at;
        if matches!(self.characters.get(self.at), Some('e' | 'E')) {
            self.at += 1;
            let signed = matches!(self.characters.get(self.at), Some('+' | '-'));
            self.at += usize::from(signed);
            if self.run(digit) == 0 {
                self.at = mantissa;
            }
        }
        let written: String = self.characters[from..self.at].iter().collect();
        match written.parse::<f64>() {
            Ok(value) if value.is_finite() => self.steps.push(Step::Number(value)),
            _ => {
                self.at = from;
                return Err(self.expected("a finite number"));
            }
        }
        Ok(())
    }

    fn name(&mut self, level: usize) -> Result<()> {
        let from = self.at;
        self.run(|c| c.is_ascii_alphanumeric() || c == '_');
        let name: String = self.characters[from..self.at].iter().collect();
        let function = match name.as_str() {
            "sqrt" => Some(Step::Sqrt),
            "exp" => Some(Step::Exp),
            "log" => Some(Step::Log),
            _ => None,
        };
        if let Some(function) = function {
            if self.peek() != Some('(') {
                return Err(self.expected(&format!("a bracket after {name}")));
            }
            self.bracket(level)?;
            self.steps.push(function);
            return Ok(());
        }
        let Some(place) = self.infos.iter().position(|info| info.name == name) else {
            let names: Vec<&str> = self.infos.iter().map(|info| info.name).collect();
            let (names, short) = (names.join(", "), shown_text(&name));
            let expected = format!("one of {names} at character {}, not {short}", from + 1);
            return Err(self.refuse(expected));
        };
        self.steps.push(Step::Parameter(place));
        Ok(())
    }
}
