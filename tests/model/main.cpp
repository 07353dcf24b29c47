// SPDX-License-Identifier: BSD-3-Clause
// Explores all models, and all changes of them: each model has to hold, and each change has to
// have the effect that is expected of it.
#include <chrono>
#include <cstring>
#include <iomanip>
#include <iostream>

#include "models.hpp"

using namespace versavis::model;

namespace {

constexpr int wrong_usage = 64;

Collection everything() {
    Collection all = publishing();
    for (const Collection& more : {waiting(), watching()}) {
        all.subjects.insert(all.subjects.end(), more.subjects.begin(), more.subjects.end());
        all.changes.insert(all.changes.end(), more.changes.begin(), more.changes.end());
    }
    return all;
}

const Subject* find(const Collection& all, const std::string& name) {
    for (const Subject& subject : all.subjects)
        if (subject.name == name) return &subject;
    return nullptr;
}

std::string name_of(const Change& change) { return change.subject + ": " + change.name; }

void print(const Result& result) {
    for (const std::string& step : result.trace) std::cout << "    " << step << '\n';
    std::cout << "    => " << result.violation << '\n';
}

bool judge(const Subject& subject) {
    const auto begin = std::chrono::steady_clock::now();
    const Result result = explore(subject.make(Twist()));
    const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begin;
    std::cout << (result.holds() ? "holds   " : "BROKEN  ") << std::left << std::setw(18)
              << subject.name << std::right << std::setw(8) << result.states << " states "
              << std::fixed << std::setprecision(1) << std::setw(5) << took.count() << " s  "
              << subject.what << std::endl;
    if (!result.holds()) print(result);
    return result.holds();
}

bool judge(const Collection& all, const Change& change) {
    const Subject* subject = find(all, change.subject);
    const Twist twist(change.name);
    if (subject == nullptr) {
        std::cout << "UNKNOWN " << name_of(change) << '\n';
        return false;
    }
    const Result result = explore(subject->make(twist));
    const bool right = twist.met() && result.holds() == (change.effect == Effect::none);
    std::cout << (right ? "" : "WRONG: ") << (result.holds() ? "harmless  " : "caught    ")
              << std::left << std::setw(7) << change.pair << " " << name_of(change);
    if (!twist.met()) std::cout << " (this model knows no such change)";
    if (!result.holds())
        std::cout << " (" << result.trace.size() << " steps: " << result.violation << ")";
    std::cout << std::endl;
    return right;
}

int judge_all(const Collection& all) {
    int wrong = 0;
    std::size_t caught = 0;
    for (const Subject& subject : all.subjects) wrong += judge(subject) ? 0 : 1;
    for (const Change& change : all.changes) {
        wrong += judge(all, change) ? 0 : 1;
        caught += change.effect == Effect::breaks ? 1 : 0;
    }
    std::cout << all.subjects.size() << " models, " << caught << " changes that must break one, "
              << all.changes.size() - caught << " that must not: " << wrong << " wrong\n";
    return wrong == 0 ? 0 : 1;
}

int list(const Collection& all) {
    for (const Subject& subject : all.subjects)
        std::cout << subject.name << "  (" << subject.what << ")\n";
    for (const Change& change : all.changes)
        std::cout << name_of(change) << "  (" << change.pair << ", "
                  << (change.effect == Effect::breaks ? "must break it" : "harmless") << ")\n";
    return 0;
}

int trace(const Collection& all, const std::string& name) {
    const auto colon = name.find(": ");
    const Subject* subject = find(all, name.substr(0, colon));
    const Twist twist(colon == std::string::npos ? "" : name.substr(colon + 2));
    const auto model = subject != nullptr ? subject->make(twist) : Model();
    if (subject == nullptr || (colon != std::string::npos && !twist.met())) {
        std::cerr << "model: nothing is named '" << name << "'; --list shows the names\n";
        return wrong_usage;
    }
    const Result result = explore(model);
    std::cout << name << ": " << result.states << " states\n";
    if (result.holds())
        std::cout << "    it holds\n";
    else
        print(result);
    return 0;
}

}  // namespace

int main(int argc, char** argv) {
    const Collection all = everything();
    if (argc == 1) return judge_all(all);
    if (argc == 2 && std::strcmp(argv[1], "--list") == 0) return list(all);
    if (argc == 3 && std::strcmp(argv[1], "--trace") == 0) return trace(all, argv[2]);
    std::cerr << "usage: model [--list | --trace 'MODEL[: CHANGE]']\n";
    return wrong_usage;
}
