#pragma once
/// What predictions of logs show, in words: parts of the verdict's sentence, of validate's and of tables.

#include <string>
#include <vector>

#include "oted/run/design_record.h"

namespace oted {

/// The horizon that is talked of: the longest up to half a second over which the design is surely better than the
/// nominal simulator, of windows that were kept aside. Where there is none, a longer one; else the longest up to half a
/// second of such windows, if any was.
const DesignRecord::Validation::Horizon& ShownHorizon(const DesignRecord::Validation& validation);

/// What a shown horizon leaves out, to be appended to a sentence about it: longer horizons over which the design is not
/// surely better, and the channel that it predicts worst beside the nominal simulator, where it does so by a tenth.
std::string ButElsewhere(const DesignRecord::Validation& validation);

/// The channels that the design predicts no better than a guess, and over which horizons, to be appended to a sentence
/// that it predicts better than the nominal simulator.
std::string ButAGuess(const DesignRecord::Validation& validation);
/// "elbow 0.021 rad (sensors alone: 0.003) and 2 other channels"; of another horizon than the shown one, named, where
/// it is there that the channel is off.
/// @param off  as VerdictSentence, at least one
std::string WhatRemains(const DesignRecord::Validation& validation, const DesignRecord::Validation::Horizon& shown,
                        const std::vector<int>& off);
/// How far replays can be followed, and how the two simulators compare there; empty where the record has none.
std::string LongestInWords(const DesignRecord::Validation& validation);
/// That windows are too few, too unlike each other, or what the design learned from, to show whether the floor is
/// reached; empty where they show it.
std::string NotTold(const DesignRecord::Validation& validation);
/// Episodes that are predicted far worse than most, to be appended to a sentence.
std::string ButOdd(const DesignRecord::Validation& validation);
/// That longer replays are worse than the nominal simulator's, to be appended to a good word.
std::string ButOverLonger(const DesignRecord::Validation& validation);

/// What a prediction is no better than where it is no better than a guess.
inline constexpr const char* kGuesses = "its mean, that it stays, that it goes on as it began";
/// Of logs that no simulator can be judged by (ShowsNothing).
inline constexpr const char* kNothingShown =
    "these logs show nothing to judge a simulator by: none predicts them better than the mean of each channel does; "
    "record motion that is larger than the sensors' noise";

/// "64 %", of an error that is so much less; "over 99 %" where something is left of it.
std::string ShareInWords(double narrowed);

/// "64 % less" of an error, "12 % more" where it is larger.
std::string LessOrMore(double narrowed);

/// "0.5 s", or "10 control steps" where time has no unit.
std::string InWords(const DesignRecord::Validation::Horizon& horizon);

/// "joint/hip/qvel [rad/s]"; one that is not judged has a star behind it.
std::string InWords(const DesignRecord::Validation::Channel& channel);

/// Lines under a table of errors: what a star means, and where percentages show less than the table. Empty where there
/// is neither.
std::string NotesOf(const DesignRecord::Validation::Horizon& horizon);

/// "3 windows".
std::string WindowsOf(const DesignRecord::Validation::Horizon& horizon);

/// Three names at most, the last of them how many there are beside.
std::vector<std::string> FewOf(const std::vector<std::string>& channels);

/// "0.2 rad/s".
std::string WithUnit(double value, const std::string& unit);

/// Where no channel is surely above what the sensors leave: that in which the errors of a few windows are, to be
/// appended; empty where none is.
std::string ButByChance(const DesignRecord::Validation::Horizon& shown);

}  // namespace oted
