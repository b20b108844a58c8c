// hdf5.h by libhdf5: reading in a child process, as a damaged file can crash or hang the library.
#include "oted/data/hdf5.h"
#include "oted/data/libhdf5/dataset_pipe.h"
#include "oted/data/libhdf5/source.h"
#include "oted/data/libhdf5/writer.h"

namespace oted {

Dataset ReadHdf5File(const std::string& file, const ChildLimits& limits,
                     const std::function<Dataset(const Hdf5Reader&)>& read) {
  return ReadInChild(file, limits, [&] {
    const Hdf5Quiet quiet;
    return read(Hdf5Source(file));
  });
}

void WriteHdf5File(const std::string& temporary_path, const std::string& path,
                   const std::function<void(Hdf5Output&)>& write) {
  const Hdf5Session session;
  Hdf5Writer writer(temporary_path, path);
  write(writer);
  writer.Close();
}

}  // namespace oted
