#include "fmu/process.hpp"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <cstdlib>
#include <stdexcept>
#include <string>

#include "fmu/resource_uri.hpp"

namespace amiss::fmu {
namespace {

// What `work` writes to the descriptor that it gets, in a process of its own, until nobody holds it any more.
template <class Work>
std::string written_by(const Work& work) {
  int ends[2];
  if (pipe(ends) != 0) throw std::runtime_error("no pipe");
  const pid_t child = fork();
  if (child == 0) {
    close(ends[0]);
    work(ends[1]);
    _exit(0);
  }
  close(ends[1]);
  std::string text;
  char part[100];
  for (ssize_t n = 0; (n = read(ends[0], part, sizeof part)) > 0;)
    text.append(part, static_cast<std::size_t>(n));
  close(ends[0]);
  waitpid(child, nullptr, 0);
  return text;
}

TEST(Process, EndsWithItsParent) {
  // The parent leaves while its child waits for ever, holding the pipe.
  EXPECT_EQ(written_by([](int) {
              const pid_t parent = getpid();
              if (fork() == 0) {
                setpgid(0, 0);
                end_with_parent(parent);
                for (;;) pause();
              }
            }),
            "");
}

TEST(Process, KeepsWhatIsPrintedOutOfItsAnswers) {
  EXPECT_EQ(written_by([](int descriptor) {
              dup2(descriptor, 1);
              close(descriptor);
              FILE* errors = std::tmpfile();
              dup2(fileno(errors), 2);
              const int answers = separate_output();
              if (write(1, "printed\n", 8) != 8) _exit(1);
              write_line(answers, "answered");
              write_line(answers, std::to_string(lseek(2, 0, SEEK_END)));
              empty_standard_error();
              write_line(answers, std::to_string(lseek(2, 0, SEEK_END)));
            }),
            "answered\n8\n0\n");
}

TEST(Process, SaysThatNobodyReads) {
  int ends[2];
  ASSERT_EQ(pipe(ends), 0);
  close(ends[0]);
  const auto before = std::signal(SIGPIPE, SIG_IGN);
  EXPECT_THROW(write_line(ends[1], "answered"), std::runtime_error);
  std::signal(SIGPIPE, before);
  close(ends[1]);
}

TEST(ResourceUri, EscapesWhatIsNoLetter) {
  EXPECT_EQ(resource_uri("/tmp/a-b_1.c~d"), "file:///tmp/a-b_1.c~d");
  EXPECT_EQ(resource_uri("/tmp/a b%#?"), "file:///tmp/a%20b%25%23%3F");
  EXPECT_EQ(resource_uri("/tmp/\xc3\xa4"), "file:///tmp/%C3%A4");
  EXPECT_EQ(resource_uri("C:\\a\\b"), "file:///C:/a/b");
}

}  // namespace
}  // namespace amiss::fmu
