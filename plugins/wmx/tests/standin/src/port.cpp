// The fault port as a program.
extern "C" int standin_port(int count, char **words);

int main(int count, char **words) { return standin_port(count, words); }
